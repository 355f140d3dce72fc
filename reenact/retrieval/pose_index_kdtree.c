// Order of points by recursive halving (k-d tree leaves).
#include "reenact/retrieval/pose_index_packed.h"

enum {
    CANDIDATES = 5, // widest dimensions tried at each split; more than three gain little
    SAMPLE = 256,   // points of a range from which its extents are estimated; chosen by hand
    DIMENSIONS_MOST = 3 * POSE_INDEX_MAX_POSITIONS + 1,
};

// A point's coordinate in one dimension (3 * position + axis; the last is the fixed cost), units.
static int16_t key_of(const struct pose_index *n, int64_t point, int dimension)
{
    return dimension < 3 * n->positions ? pose_index_coordinate(n, point, dimension) : pose_index_fixed_cost(n, point);
}

// ---------------------------------------------------------------- selection

// Whether point a comes before b: a total order.
static bool precedes(const struct pose_index *n, int dimension, int64_t a, int64_t b)
{
    int16_t at_a = key_of(n, a, dimension), at_b = key_of(n, b, dimension);
    return at_a < at_b || (at_a == at_b && a < b);
}

// Quickselect (Hoare 1961): afterwards no point before `middle` comes after one from there on.
static void partition(const struct pose_index *n, int dimension, int64_t *points, int64_t count, int64_t middle)
{
    int64_t low = 0, high = count - 1;
    while (low < high) {
        int64_t pivot = points[low + (high - low) / 2], i = low, j = high;
        while (i <= j) {
            while (precedes(n, dimension, points[i], pivot))
                i++;
            while (precedes(n, dimension, pivot, points[j]))
                j--;
            if (i <= j) {
                int64_t swapped = points[i];
                points[i++] = points[j];
                points[j--] = swapped;
            }
        }
        if (middle <= j)
            high = j;
        else if (middle >= i)
            low = i;
        else
            return;
    }
}

// ---------------------------------------------------------------- split dimension

// The sum of squared differences from the mean, of each dimension.
static void squares_of(const struct pose_index *n, const int64_t *points, int64_t count, double *squares)
{
    for (int d = 0; d <= 3 * n->positions; d++) {
        int64_t sum = 0, of_squares = 0;
        for (int64_t i = 0; i < count; i++) {
            int64_t key = key_of(n, points[i], d);
            sum += key;
            of_squares += key * key;
        }
        squares[d] = (double)of_squares - (double)sum / (double)count * (double)sum;
        squares[d] = squares[d] > 0 ? squares[d] : 0; // rounding
    }
}

// Spread of a range in terms of costs: the sum over positions of the root mean square distance from the mean, and that
// of the fixed costs, times the number of points.
static double extent(const struct pose_index *n, const int64_t *points, int64_t count)
{
    double squares[DIMENSIONS_MOST], sum = 0;
    squares_of(n, points, count, squares);
    for (int p = 0; p < n->positions; p++)
        sum += sqrt((squares[3 * p] + squares[3 * p + 1] + squares[3 * p + 2]) * (double)count);
    return sum + sqrt(squares[3 * n->positions] * (double)count);
}

// Which of the widest dimensions to split across, so that the two parts, of `half` and `count` - `half` points, have
// the least total spread; estimated on a sample.
static int best_dimension(const struct pose_index *n, const int64_t *points, int64_t count, int64_t half)
{
    int64_t sample[SAMPLE], many = count < SAMPLE ? count : SAMPLE, first = half * many / count;
    double squares[DIMENSIONS_MOST], least = INFINITY;
    int best = 0;
    for (int64_t i = 0; i < many; i++)
        sample[i] = points[i * count / many];
    squares_of(n, sample, many, squares);
    for (int tried = 0; tried < CANDIDATES && tried <= 3 * n->positions; tried++) {
        int widest = 0;
        for (int d = 1; d <= 3 * n->positions; d++)
            if (squares[d] > squares[widest])
                widest = d;
        squares[widest] = -1;
        partition(n, widest, sample, many, first);
        double here = extent(n, sample, first) + extent(n, sample + first, many - first);
        if (here < least) {
            least = here;
            best = widest;
        }
    }
    return best;
}

void pose_index_order_kdtree(const struct pose_index *n, int64_t *points, int64_t count)
{
    while (count > LANES) {
        int64_t group = LANES * LANES, unit = count > LANES * group ? LANES * group : count > group ? group : LANES;
        int64_t half = (count / 2 + unit - 1) / unit * unit;
        partition(n, best_dimension(n, points, count, half), points, count, half);
        pose_index_order_kdtree(n, points, half);
        points += half;
        count -= half;
    }
}
