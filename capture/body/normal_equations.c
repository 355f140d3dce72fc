#include "capture/body/normal_equations.h"

#include <string.h>

// Information that every unknown has beside the evidence, and the smallest pivot of a positive definite matrix: far
// below those of any prior.
static const double DIAGONAL_MIN = 1e-3, PIVOT_MIN = 1e-9;

void normal_equations_reset(struct normal_equations *equations, bool with_shape)
{
    memset(equations, 0, sizeof *equations);
    equations->count = with_shape ? FIT_COUNT : FIT_POSE_COUNT;
}

void normal_equations_add(struct normal_equations *equations, const struct body_build *build,
                          const struct point_residual *point_residual)
{
    if (!equations)
        return;
    const struct vec3 n = point_residual->normal, moment = v3_cross(v3_sub(point_residual->point, build->origin[0]), n);
    const double residual = point_residual->residual, weight = point_residual->weight, *shape = point_residual->shape;
    const double j[TWIST_COUNT] = {n.x, n.y, n.z, moment.x, moment.y, moment.z};
    struct segment_sum *sum = &equations->sum[point_residual->segment];
    for (int a = 0; a < TWIST_COUNT; a++) {
        double w = weight * j[a];
        sum->g[a] += w * residual;
        for (int b = 0; b <= a; b++)
            sum->h[a][b] += w * j[b];
    }
    for (int k = 0; shape && k < SHAPE_COUNT; k++) {
        double w = weight * shape[k];
        if (w == 0)
            continue;
        for (int a = 0; a < TWIST_COUNT; a++)
            sum->shape[k][a] += w * j[a];
        equations->g[FIT_POSE_COUNT + k] += w * residual;
        for (int b = 0; b <= k; b++)
            equations->h[FIT_POSE_COUNT + k][FIT_POSE_COUNT + b] += w * shape[b];
    }
}

static void add_segment_sum(struct segment_sum *to, const struct segment_sum *from, bool shape)
{
    for (int a = 0; a < TWIST_COUNT; a++) {
        to->g[a] += from->g[a];
        for (int b = 0; b <= a; b++)
            to->h[a][b] += from->h[a][b];
    }
    for (int k = 0; shape && k < SHAPE_COUNT; k++)
        for (int a = 0; a < TWIST_COUNT; a++)
            to->shape[k][a] += from->shape[k][a];
}

static double dot6(const double a[TWIST_COUNT], const double b[TWIST_COUNT])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5];
}

// The twist of everything below segment s per rotation of s about axis k of its parent.
static void segment_twist(const struct body_build *build, int s, int k, double out[TWIST_COUNT])
{
    struct vec3 axis = v3(build->parent_axes[s][0][k], build->parent_axes[s][1][k], build->parent_axes[s][2][k]),
                along = v3_cross(v3_sub(build->origin[s], build->origin[0]), axis);
    out[0] = along.x, out[1] = along.y, out[2] = along.z, out[3] = axis.x, out[4] = axis.y, out[5] = axis.z;
}

// Segment by segment from the ends inwards.
void normal_equations_assemble(struct normal_equations *equations, const struct body_build *build)
{
    double twist[SEG_COUNT][3][TWIST_COUNT];
    bool shape = equations->count == FIT_COUNT;
    for (int i = 0; i < SEG_COUNT; i++)
        for (int k = 0; k < 3; k++)
            segment_twist(build, i, k, twist[i][k]);
    for (int i = SEG_COUNT - 1; i >= 0; i--) {
        struct segment_sum *sum = &equations->sum[i];
        for (int k = 0; k < 3; k++) {
            double force[TWIST_COUNT];
            for (int a = 0; a < TWIST_COUNT; a++) {
                force[a] = 0;
                for (int b = 0; b < TWIST_COUNT; b++)
                    force[a] += sum->h[a > b ? a : b][a > b ? b : a] * twist[i][k][b];
            }
            int row = 3 + 3 * i + k;
            equations->g[row] += dot6(sum->g, twist[i][k]);
            for (int m = 0; m < 3; m++)
                equations->h[row][m] += force[m];
            for (int up = i; up >= 0; up = body_parent((enum segment)up))
                for (int m = 0; m < (up == i ? k + 1 : 3); m++)
                    equations->h[row][3 + 3 * up + m] += dot6(force, twist[up][m]);
            for (int a = 0; shape && a < SHAPE_COUNT; a++)
                equations->h[FIT_POSE_COUNT + a][row] += dot6(sum->shape[a], twist[i][k]);
        }
        if (i > 0)
            add_segment_sum(&equations->sum[body_parent((enum segment)i)], sum, shape);
    }
    for (int m = 0; m < 3; m++) { // the root's translation
        equations->g[m] += equations->sum[0].g[m];
        for (int b = 0; b <= m; b++)
            equations->h[m][b] += equations->sum[0].h[m][b];
        for (int a = 0; shape && a < SHAPE_COUNT; a++)
            equations->h[FIT_POSE_COUNT + a][m] += equations->sum[0].shape[a][m];
    }
}

// Elimination order without fill-in (Featherstone, section 6.5): limbs from their ends inwards, the shape last.
// Segments that are not above or below each other have no common entry then, so that of each row only the entries from
// `first` on, that of its outermost descendant, are ever nonzero.
struct elimination {
    int unknown[FIT_COUNT], first[FIT_COUNT]; // by row
};

static struct elimination elimination_order(int count)
{
    struct elimination e;
    int outermost[SEG_COUNT];
    for (int s = SEG_COUNT - 1; s >= 0; s--)
        outermost[s] = s;
    for (int s = SEG_COUNT - 1; s > 0; s--) {
        int up = body_parent((enum segment)s);
        outermost[up] = outermost[s] > outermost[up] ? outermost[s] : outermost[up];
    }
    for (int row = 0; row < count; row++) {
        int i = row < FIT_POSE_COUNT ? FIT_POSE_COUNT - 1 - row : row;
        e.unknown[row] = i;
        e.first[row] = i < 3 || i >= FIT_POSE_COUNT ? 0 : FIT_POSE_COUNT - 1 - (5 + 3 * outermost[i / 3 - 1]);
    }
    return e;
}

// Not cholesky_factor() of base/linear_algebra.h: it skips the zeros left of each row's first unknown (a skyline),
// damps the diagonal on the way, and solves in the same sweep, in an order that gives other roundings.
bool normal_equations_solve(const struct normal_equations *equations, double damping, double x[FIT_COUNT])
{
    double l[FIT_COUNT][FIT_COUNT], y[FIT_COUNT];
    bool finite = true;
    struct elimination e = elimination_order(equations->count);
    for (int i = 0; i < equations->count; i++) {
        int a = e.unknown[i];
        for (int j = e.first[i]; j <= i; j++) {
            int b = e.unknown[j], from = e.first[i] > e.first[j] ? e.first[i] : e.first[j];
            double sum = a > b ? equations->h[a][b] : equations->h[b][a];
            if (i == j)
                sum += damping * sum + DIAGONAL_MIN;
            for (int k = from; k < j; k++)
                sum -= l[i][k] * l[j][k];
            if (i == j && !(sum > PIVOT_MIN))
                return false;
            l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
        }
        y[i] = equations->g[a];
        for (int k = e.first[i]; k < i; k++)
            y[i] -= l[i][k] * y[k];
        y[i] /= l[i][i];
    }
    for (int i = equations->count - 1; i >= 0; i--) {
        y[i] /= l[i][i];
        x[e.unknown[i]] = y[i];
        finite = finite && isfinite(y[i]);
        for (int k = e.first[i]; k < i; k++)
            y[k] -= l[i][k] * y[i];
    }
    return finite;
}

// Not marginal_information() of base/linear_algebra.h: the two parts differ in size, and pivots are clamped.
void normal_equations_shape_information(const struct normal_equations *equations,
                                        double information[SHAPE_COUNT][SHAPE_COUNT])
{
    double l[FIT_COUNT][FIT_COUNT];
    for (int i = 0; i < FIT_COUNT; i++)
        for (int j = 0; j <= i; j++) {
            double sum = equations->h[i][j] + (i == j ? DIAGONAL_MIN : 0);
            int last = j < FIT_POSE_COUNT ? j : FIT_POSE_COUNT;
            for (int k = 0; k < last; k++)
                sum -= l[i][k] * l[j][k];
            if (i < FIT_POSE_COUNT && i == j)
                l[i][i] = sqrt(fmax(sum, PIVOT_MIN));
            else
                l[i][j] = j < FIT_POSE_COUNT ? sum / l[j][j] : sum;
        }
    for (int a = 0; a < SHAPE_COUNT; a++)
        for (int b = 0; b <= a; b++)
            information[a][b] = information[b][a] = l[FIT_POSE_COUNT + a][FIT_POSE_COUNT + b];
}
