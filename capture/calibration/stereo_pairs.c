#include "capture/calibration/stereo_pairs.h"

#include <stdlib.h>
#include <string.h>

// How far, as a share of the picture's width, the circles of a pair may lie from where the pose between the cameras
// puts them. Two cameras whose focal lengths are each known to 5 % only stay below; pictures of two instants between
// which a hand has moved the board do not. Chosen by hand; on which sets is said in stereo_calibration.c.
static const double AGREE_SHARE = 0.03;

enum {
    MAX_PROPOSING = 48, // pairs that propose a pose
    MAX_COMPARED = 12,  // circles of a pair that are compared
    MAX_SHIFT = 4,      // by which the names in the two folders may be out of step, for the sentence
};

// The motion of the lattice that turns it by `quarter` quarter turns about its origin and then shifts it.
static struct pose stereo_lattice_motion(int quarter, double column, double row, double pitch_m)
{
    static const double half[4][2] = {{0, 1},
                                      {0.70710678118654752, 0.70710678118654752},
                                      {1, 0},
                                      {0.70710678118654752, -0.70710678118654752}}; // sine, cosine of half the angle
    return (struct pose){{0, 0, half[quarter][0], half[quarter][1]}, v3(column * pitch_m, row * pitch_m, 0)};
}

struct extent {
    int columns, rows;
};

static struct extent lattice_extent(const struct circle *circles, int count)
{
    struct extent e = {0, 0};
    for (int i = 0; i < count; i++) {
        e.columns = circles[i].column >= e.columns ? circles[i].column + 1 : e.columns;
        e.rows = circles[i].row >= e.rows ? circles[i].row + 1 : e.rows;
    }
    return e;
}

// The lattice reaches over the whole board, so that its place on it is known but for turns; a circle may be missing.
static bool is_whole(const struct stereo_board *board, struct extent extent)
{
    return (extent.columns == board->columns && extent.rows == board->rows) ||
           (extent.columns == board->rows && extent.rows == board->columns);
}

static struct extent extent_of(const struct stereo_pairs *pairs, int camera, int view)
{
    return lattice_extent(pairs->views[view].circles[camera], pairs->views[view].count[camera]);
}

static bool both_whole(const struct stereo_pairs *pairs, int left, int right)
{
    return is_whole(pairs->board, extent_of(pairs, 0, left)) && is_whole(pairs->board, extent_of(pairs, 1, right));
}

// Whether the right lattice, turned by `quarter`, reaches as far as the left one.
static bool fits_turned(struct extent left, struct extent right, int quarter)
{
    return quarter % 2 ? left.columns == right.rows && left.rows == right.columns
                       : left.columns == right.columns && left.rows == right.rows;
}

// Two whole lattices: the right one turned begins where the left one does. (c, r) turned by a quarter is (-r, c).
static struct pose whole_motion(const struct stereo_pairs *pairs, struct extent right, int quarter)
{
    const int columns = right.columns - 1, rows = right.rows - 1;
    double x = 0, y = 0;
    switch (quarter) {
    case 1: x = rows; break;
    case 2: x = columns, y = rows; break;
    case 3: y = columns; break;
    default: break;
    }
    return stereo_lattice_motion(quarter, x, y, pairs->board->pitch_m);
}

static struct pose rig_by(const struct stereo_pairs *pairs, int left, int right, struct pose motion)
{
    return pose_multiply(pairs->camera_from_board[1][right],
                         pose_inverse(pose_multiply(pairs->camera_from_board[0][left], motion)));
}

struct pose stereo_pairs_motion(const struct stereo_pairs *pairs, int left, int right, struct pose right_from_left)
{
    const double pitch_m = pairs->board->pitch_m;
    const struct extent left_extent = extent_of(pairs, 0, left), right_extent = extent_of(pairs, 1, right);
    const bool whole = is_whole(pairs->board, left_extent) && is_whole(pairs->board, right_extent);
    int best = 0;
    double min = INFINITY;
    for (int quarter = 0; quarter < 4; quarter++) {
        if (whole && !fits_turned(left_extent, right_extent, quarter))
            continue;
        const struct pose rig = rig_by(pairs, left, right, stereo_lattice_motion(quarter, 0, 0, pitch_m));
        const double angle = pose_angle(rig, right_from_left);
        if (angle < min) {
            min = angle;
            best = quarter;
        }
    }
    if (whole)
        return whole_motion(pairs, right_extent, best);
    // The right board in the left board's axes, rounded to the lattice.
    const struct pose m = pose_multiply(pose_inverse(pose_multiply(right_from_left, pairs->camera_from_board[0][left])),
                                        pairs->camera_from_board[1][right]);
    return stereo_lattice_motion(best, floor(m.translation.x / pitch_m + 0.5), floor(m.translation.y / pitch_m + 0.5),
                                 pitch_m);
}

// Root of the mean squared distance, pixels, of the right camera's circles from where the left camera's board and the
// pose between the cameras put them.
static double disagreement_px(const struct stereo_pairs *pairs, int left, int right, struct pose right_from_left)
{
    const struct pose right_from_board =
        pose_multiply(right_from_left, pose_multiply(pairs->camera_from_board[0][left],
                                                     stereo_pairs_motion(pairs, left, right, right_from_left)));
    const double max_r2 = lens_max_radius2(&pairs->lens[1]), pitch_m = pairs->board->pitch_m;
    const int count = pairs->views[right].count[1], step = count / MAX_COMPARED + 1;
    double sum = 0;
    int compared = 0;
    for (int i = 0; i < count; i += step, compared++) {
        const struct circle *c = &pairs->views[right].circles[1][i];
        const struct vec3 point = pose_apply(right_from_board, v3(c->column * pitch_m, c->row * pitch_m, 0));
        if (!(point.z > 1e-3))
            return INFINITY;
        const struct pixel at = lens_project_clamped(&pairs->lens[1], max_r2, point);
        sum += (at.x - c->at.x) * (at.x - c->at.x) + (at.y - c->at.y) * (at.y - c->at.y);
    }
    return sqrt(sum / compared);
}

struct proposal {
    struct pose right_from_left;
    int agreeing;
    double sum_px, turn_rad; // of the agreeing pairs' disagreement; of one camera against the other
};

static bool is_better(const struct proposal *a, const struct proposal *b)
{
    if (a->agreeing != b->agreeing)
        return a->agreeing > b->agreeing;
    // One pair alone fits each of the board's equal turns: cameras are seldom turned against each other.
    return a->agreeing <= 1 ? a->turn_rad < b->turn_rad : a->sum_px < b->sum_px;
}

static void judge_proposal(const struct stereo_pairs *pairs, int shift, struct proposal *of)
{
    const double max_px = AGREE_SHARE * pairs->lens[0].width;
    of->agreeing = 0;
    of->sum_px = 0;
    of->turn_rad = pose_angle(of->right_from_left, POSE_IDENTITY);
    for (int left = 0; left < pairs->count; left++) {
        const int right = left + shift;
        if (right < 0 || right >= pairs->count || !pairs->seen[0][left] || !pairs->seen[1][right])
            continue;
        const double px = disagreement_px(pairs, left, right, of->right_from_left);
        if (px > max_px)
            continue;
        of->agreeing++;
        of->sum_px += px;
    }
}

// The best of all proposals of pairs whose right picture is `shift` after the left one. False: no pair can propose.
static bool best_proposal(const struct stereo_pairs *pairs, int shift, struct proposal *best)
{
    int whole = 0, at = 0;
    for (int left = 0; left < pairs->count; left++)
        whole += left + shift >= 0 && left + shift < pairs->count && pairs->seen[0][left] &&
                 pairs->seen[1][left + shift] && both_whole(pairs, left, left + shift);
    const int step = whole / MAX_PROPOSING + 1;
    *best = (struct proposal){.agreeing = -1};
    for (int left = 0; left < pairs->count; left++) {
        const int right = left + shift;
        if (right < 0 || right >= pairs->count || !pairs->seen[0][left] || !pairs->seen[1][right] ||
            !both_whole(pairs, left, right) || at++ % step)
            continue;
        const struct extent left_extent = extent_of(pairs, 0, left), right_extent = extent_of(pairs, 1, right);
        for (int quarter = 0; quarter < 4; quarter++) {
            struct proposal by;
            if (!fits_turned(left_extent, right_extent, quarter))
                continue;
            by.right_from_left = rig_by(pairs, left, right, whole_motion(pairs, right_extent, quarter));
            judge_proposal(pairs, shift, &by);
            if (is_better(&by, best))
                *best = by;
        }
    }
    return whole > 0;
}

// ------------------------------------------------------------- what is said

static enum status fail_without_whole_board(const struct stereo_pairs *pairs)
{
    struct extent max = {0, 0};
    for (int v = 0; v < pairs->count; v++)
        for (int camera = 0; camera < 2; camera++) {
            const struct extent e = extent_of(pairs, camera, v);
            if (pairs->seen[camera][v] && e.columns * e.rows > max.columns * max.rows)
                max = e.columns >= e.rows ? e : (struct extent){e.rows, e.columns};
        }
    const int columns = pairs->board->columns, rows = pairs->board->rows;
    const int longer = columns > rows ? columns : rows, shorter = columns > rows ? rows : columns;
    if (max.columns > longer || max.rows > shorter)
        return fail(ERR_INPUT,
                    "the board has more circles than was said, %d x %d: the pictures show %d x %d of them; correct "
                    "\"columns\" and \"rows\" in board.json",
                    columns, rows, max.columns, max.rows);
    return fail(ERR_INPUT,
                "no pair of pictures shows the whole board of %d x %d circles to both cameras, at most %d x %d of "
                "them; hold it further away in some, or correct \"columns\" and \"rows\" in board.json",
                columns, rows, max.columns, max.rows);
}

// What the right camera would have seen and found, were its pictures mirrored; NULL: no memory.
struct mirrored {
    struct stereo_view *views;
    struct circle *circles;
    struct pose *poses;
};

static struct vec3 mirror_point(struct vec3 p) { return v3(-p.x, p.y, p.z); }

// A lattice keeps its sense of rotation: its columns become rows. The board's axes are mirrored likewise.
static struct pose mirror_pose(struct pose camera_from_board)
{
    double m[3][3];
    quat_to_matrix(camera_from_board.rotation, m);
    double turned[3][3] = {{-m[0][1], -m[0][0], -m[0][2]}, {m[1][1], m[1][0], m[1][2]}, {m[2][1], m[2][0], m[2][2]}};
    return (struct pose){quat_from_matrix(turned), mirror_point(camera_from_board.translation)};
}

static bool mirror_right(struct stereo_pairs *pairs, struct mirrored *storage)
{
    size_t circles = 0;
    for (int v = 0; v < pairs->count; v++)
        circles += (size_t)pairs->views[v].count[1];
    storage->views = malloc((size_t)pairs->count * sizeof *storage->views);
    storage->circles = malloc((circles + 1) * sizeof *storage->circles);
    storage->poses = malloc((size_t)pairs->count * sizeof *storage->poses);
    if (!storage->views || !storage->circles || !storage->poses)
        return false;
    struct circle *next = storage->circles;
    for (int v = 0; v < pairs->count; v++) {
        storage->views[v] = pairs->views[v];
        storage->views[v].circles[1] = next;
        for (int i = 0; i < pairs->views[v].count[1]; i++, next++) {
            *next = pairs->views[v].circles[1][i];
            next->at.x = pairs->lens[1].width - 1 - next->at.x;
            next->column = pairs->views[v].circles[1][i].row;
            next->row = pairs->views[v].circles[1][i].column;
        }
        if (pairs->seen[1][v])
            storage->poses[v] = mirror_pose(pairs->camera_from_board[1][v]);
    }
    pairs->views = storage->views;
    pairs->camera_from_board[1] = storage->poses;
    pairs->lens[1].cx = pairs->lens[1].width - 1 - pairs->lens[1].cx;
    pairs->lens[1].p2 = -pairs->lens[1].p2;
    return true;
}

static bool agrees_mirrored(const struct stereo_pairs *pairs, int wanted)
{
    struct stereo_pairs p = *pairs;
    struct mirrored storage = {0};
    struct proposal best = {.agreeing = 0};
    if (mirror_right(&p, &storage) && !best_proposal(&p, 0, &best))
        best.agreeing = 0;
    free(storage.views);
    free(storage.circles);
    free(storage.poses);
    return best.agreeing >= wanted;
}

// Names the likely cause: tries what is often wrong until the pairs agree.
static enum status fail_apart(const struct stereo_pairs *pairs, int agreeing, int comparable)
{
    const int wanted = comparable - comparable / 4;
    if (agrees_mirrored(pairs, wanted))
        return fail(ERR_INPUT,
                    "one camera's pictures are mirrored, the other's are not: switch that off in the camera, "
                    "or turn them over again");
    for (int k = 0; k < 2 * MAX_SHIFT; k++) {
        const int shift = k % 2 ? -(k / 2 + 1) : k / 2 + 1, left_over = shift < 0 ? -shift : shift;
        struct proposal best;
        if (best_proposal(pairs, shift, &best) && best.agreeing >= 3 && best.agreeing >= wanted - left_over)
            return fail(ERR_INPUT,
                        "the names in left and right are out of step: each left picture belongs to the right picture "
                        "%d %s it; name pictures of one instant alike",
                        left_over, shift > 0 ? "after" : "before");
    }
    return fail(ERR_INPUT,
                "the pictures in left and right do not belong together, in %d of %d pairs: pictures of the same name "
                "must be of the same instant, with the board held still, and of two cameras that are fixed to each "
                "other",
                comparable - agreeing, comparable);
}

enum status stereo_pairs_agree(const struct stereo_pairs *pairs, struct pose *right_from_left, bool *belongs,
                               int *agreeing, int *comparable)
{
    struct proposal best;
    *comparable = 0;
    for (int v = 0; v < pairs->count; v++)
        *comparable += pairs->seen[0][v] && pairs->seen[1][v];
    if (!best_proposal(pairs, 0, &best))
        return fail_without_whole_board(pairs);
    *agreeing = best.agreeing;
    if (*comparable > 1 && 2 * best.agreeing <= *comparable)
        return fail_apart(pairs, best.agreeing, *comparable);
    *right_from_left = best.right_from_left;
    for (int v = 0; v < pairs->count; v++)
        belongs[v] = pairs->seen[0][v] && pairs->seen[1][v] &&
                     disagreement_px(pairs, v, v, best.right_from_left) <= AGREE_SHARE * pairs->lens[0].width;
    return OK;
}
