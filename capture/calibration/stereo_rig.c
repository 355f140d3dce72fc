#include "capture/calibration/stereo_rig.h"

#include "platform/files/image_file.h"
#include "platform/files/json.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- stereo pairs

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

enum status stereo_pairs_agree(const struct stereo_pairs *p, struct pose *right_from_left, bool *belongs, int *agreeing,
                               int *comparable)
{
    struct proposal best;
    *comparable = 0;
    for (int v = 0; v < p->count; v++)
        *comparable += p->seen[0][v] && p->seen[1][v];
    if (!best_proposal(p, 0, &best))
        return fail_without_whole_board(p);
    *agreeing = best.agreeing;
    if (*comparable > 1 && 2 * best.agreeing <= *comparable)
        return fail_apart(p, best.agreeing, *comparable);
    *right_from_left = best.right_from_left;
    for (int v = 0; v < p->count; v++)
        belongs[v] = p->seen[0][v] && p->seen[1][v] &&
                     disagreement_px(p, v, v, best.right_from_left) <= AGREE_SHARE * p->lens[0].width;
    return OK;
}

// ---------------------------------------------------------------- stereo rig

enum { MAX_PAIRS = STEREO_MAX_PAIRS, MAX_NAME = 128 };

static const double FARTHEST_M = 100;                    // one camera from the other
static const double MIN_PITCH_M = 1e-3, MAX_BOARD_M = 5; // no printed board is finer, or larger

static enum status read_board(const char *folder, struct stereo_board *board)
{
    char path[1024];
    struct json *root;
    double columns = 0, rows = 0;
    const char *pattern = "circles";
    snprintf(path, sizeof path, "%s/board.json", folder);
    enum status status = json_read(path, &root);
    if (status == OK)
        status = json_need_number(root, "columns", path, &columns);
    if (status == OK)
        status = json_need_number(root, "rows", path, &rows);
    if (status == OK)
        status = json_need_number(root, "pitch_m", path, &board->pitch_m);
    if (status == OK) {
        (void)json_get_string(json_member(root, "pattern"), &pattern);
        if (strcmp(pattern, "circles"))
            status = fail(ERR_INPUT, "%s: the pattern '%s' is not known; print circles", path, pattern);
        else if (!(columns >= 3 && rows >= 3 && columns * rows <= STEREO_MAX_CIRCLES) || columns != floor(columns) ||
                 rows != floor(rows))
            status = fail(ERR_INPUT, "%s: a board has 3 or more whole columns and rows, and at most %d circles", path,
                          STEREO_MAX_CIRCLES);
        else if (!(board->pitch_m > MIN_PITCH_M && board->pitch_m * fmax(columns, rows) < MAX_BOARD_M))
            status = fail(ERR_INPUT,
                          "%s: pitch_m is the distance of two circles' centres in metres, 0.02 for 20 mm; %g makes a "
                          "board of %g m",
                          path, board->pitch_m, board->pitch_m * fmax(columns, rows));
    }
    if (status == OK) {
        board->columns = (int)columns;
        board->rows = (int)rows;
    }
    json_free(&root);
    return status;
}

static int compare_names(const void *a, const void *b) { return strcmp(a, b); }

static enum status list_pairs(const char *folder, char (*names)[MAX_NAME], int *count)
{
    char path[1024];
    *count = 0;
    snprintf(path, sizeof path, "%s/left", folder);
    DIR *dir = opendir(path);
    if (!dir)
        return fail(ERR_MISSING, "%s is no folder; pairs lie in left/ and right/ under equal names", path);
    enum status status = OK;
    for (struct dirent *entry; status == OK && (entry = readdir(dir));) {
        if (entry->d_name[0] == '.')
            continue;
        if (*count == MAX_PAIRS)
            status = fail(ERR_INPUT, "%s holds more than %d pictures", path, MAX_PAIRS);
        else if (strlen(entry->d_name) >= MAX_NAME)
            status = fail(ERR_INPUT, "%s: the name %.40s… is longer than %d bytes", path, entry->d_name, MAX_NAME - 1);
        else
            strcpy(names[(*count)++], entry->d_name);
    }
    closedir(dir);
    qsort(names, (size_t)*count, sizeof *names, compare_names);
    return status == OK && !*count ? fail(ERR_INPUT, "%s is empty", path) : status;
}

struct sheet {
    struct circle *circles; // of all pictures, one after the other
    struct stereo_view *views;
    int width, height;
};

static enum status find_in(const char *path, struct sheet *sheet, struct circle *out, int *count)
{
    struct image image;
    enum status status = image_read(path, &image);
    if (status != OK)
        return status;
    if (!sheet->width) {
        sheet->width = image.width;
        sheet->height = image.height;
    }
    const size_t pixels = (size_t)image.width * (size_t)image.height;
    uint8_t *gray = malloc(pixels);
    if (!gray)
        status = fail(ERR_MEMORY, "%s: no memory", path);
    else if (image.width != sheet->width || image.height != sheet->height)
        status = fail(ERR_INPUT, "%s has another size than the pictures before it", path);
    if (status == OK) {
        image_gray(image.rgb, pixels, gray);
        status = stereo_circles_find(gray, image.width, image.height, out, count);
    }
    free(gray);
    free(image.rgb);
    return status;
}

static enum status find_all(const char *folder, char (*names)[MAX_NAME], int count, struct sheet *sheet)
{
    static const char *const sides[2] = {"left", "right"};
    char path[1280];
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++)
        for (int side = 0; side < 2 && status == OK; side++) {
            struct circle *at = sheet->circles + (size_t)(2 * i + side) * STEREO_MAX_CIRCLES;
            snprintf(path, sizeof path, "%s/%s/%s", folder, sides[side], names[i]);
            sheet->views[i].circles[side] = at;
            sheet->views[i].name = names[i];
            status = find_in(path, sheet, at, &sheet->views[i].count[side]);
        }
    return status;
}

enum status stereo_calibrate_folder(const char *folder, struct stereo_rig *rig, struct stereo_report *report,
                                    int *pairs)
{
    struct stereo_board board;
    struct sheet s = {0};
    char(*names)[MAX_NAME] = malloc(MAX_PAIRS * sizeof *names);
    if (!names)
        return fail(ERR_MEMORY, "no memory to list %s", folder);
    enum status status = read_board(folder, &board);
    if (status == OK)
        status = list_pairs(folder, names, pairs);
    if (status == OK) {
        s.circles = malloc((size_t)*pairs * 2 * STEREO_MAX_CIRCLES * sizeof *s.circles);
        s.views = calloc((size_t)*pairs, sizeof *s.views);
        if (!s.circles || !s.views)
            status = fail(ERR_MEMORY, "no memory for %d pairs of pictures", *pairs);
    }
    if (status == OK)
        status = find_all(folder, names, *pairs, &s);
    if (status == OK)
        status = stereo_calibrate(&board, s.views, *pairs, s.width, s.height, rig, report);
    free(s.circles);
    free(s.views);
    free(names);
    return status;
}

static bool read_matrix(const struct json *rows, int n, double *out)
{
    if (!json_is_array(rows) || json_count(rows) != n)
        return false;
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++)
            if (json_count(json_at(rows, y)) != n || !json_get_number(json_at(json_at(rows, y), x), &out[y * n + x]))
                return false;
    return true;
}

static enum status read_lens(const struct json *root, const char *side, const char *path, struct lens *lens)
{
    const struct json *camera = json_member(root, side), *distortion = json_member(camera, "distortion");
    double k[9], d[5] = {0}, width = 640, height = 480;
    (void)json_get_number(json_member(root, "width"), &width);
    (void)json_get_number(json_member(root, "height"), &height);
    bool good = read_matrix(json_member(camera, "K"), 3, k) && json_count(distortion) <= 5 && width >= 16 &&
                height >= 16 && width < 1e5 && height < 1e5;
    for (int i = 0; good && i < json_count(distortion); i++)
        good = json_get_number(json_at(distortion, i), &d[i]);
    if (!good)
        return fail(ERR_INPUT,
                    "%s: \"%s\" needs \"K\", three rows of three numbers, and \"distortion\", k1 k2 p1 p2 k3", path,
                    side);
    *lens = (struct lens){.width = (int)width,
                          .height = (int)height,
                          .fx = k[0],
                          .fy = k[4],
                          .cx = k[2],
                          .cy = k[5],
                          .k1 = d[0],
                          .k2 = d[1],
                          .p1 = d[2],
                          .p2 = d[3],
                          .k3 = d[4]};
    return lens_check(lens, side);
}

// Optional: six numbers of a covariance.
static void read_error(const struct json *list, struct covariance3 *out)
{
    double v[6] = {0};
    *out = (struct covariance3){0};
    for (int i = 0; i < 6; i++)
        if (json_count(list) != 6 || !json_get_number(json_at(list, i), &v[i]))
            return;
    if (v[0] >= 0 && v[3] >= 0 && v[5] >= 0)
        *out = (struct covariance3){v[0], v[1], v[2], v[3], v[4], v[5]};
}

enum status stereo_rig_read(const char *path, struct stereo_rig *rig)
{
    struct json *root;
    double m[16];
    enum status status = json_read(path, &root);
    if (status == OK)
        status = read_lens(root, "left", path, &rig->left);
    if (status == OK)
        status = read_lens(root, "right", path, &rig->right);
    if (status == OK && !read_matrix(json_member(root, "left_from_right"), 4, m))
        status = fail(ERR_INPUT, "%s: \"left_from_right\" needs four rows of four numbers", path);
    if (status == OK) {
        double r[3][3] = {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}};
        rig->left_from_right = (struct pose){quat_from_matrix(r), v3(m[3], m[7], m[11])};
        if (!matrix_is_rotation(r, 1e-3))
            status = fail(ERR_INPUT, "%s: \"left_from_right\" is no rotation with a shift", path);
        else if (!(v3_length(rig->left_from_right.translation) <= FARTHEST_M))
            status =
                fail(ERR_INPUT, "%s: its cameras are %g m apart", path, v3_length(rig->left_from_right.translation));
    }
    if (status == OK)
        read_error(json_member(root, "error_at_1_m"), &rig->error_at_1m);
    json_free(&root);
    return status;
}

static void add_row(struct json *rows, const char *name, const double *values, int n)
{
    struct json *row = json_add_array(rows, name);
    for (int i = 0; i < n; i++)
        json_push_number(row, values[i]);
}

static void add_lens(struct json *root, const char *side, const struct lens *lens)
{
    struct json *camera = json_add_object(root, side), *k = json_add_array(camera, "K");
    add_row(k, NULL, (double[]){lens->fx, 0, lens->cx}, 3);
    add_row(k, NULL, (double[]){0, lens->fy, lens->cy}, 3);
    add_row(k, NULL, (double[]){0, 0, 1}, 3);
    struct json *distortion = json_add_array(camera, "distortion");
    const double d[5] = {lens->k1, lens->k2, lens->p1, lens->p2, lens->k3};
    for (int i = 0; i < 5; i++)
        json_push_number(distortion, d[i]);
}

char *stereo_rig_print(const struct stereo_rig *rig)
{
    struct json *root = json_new_object();
    double m[3][3];
    add_lens(root, "left", &rig->left);
    add_lens(root, "right", &rig->right);
    struct json *rows = json_add_array(root, "left_from_right");
    quat_to_matrix(rig->left_from_right.rotation, m);
    const double t[3] = {rig->left_from_right.translation.x, rig->left_from_right.translation.y,
                         rig->left_from_right.translation.z};
    for (int y = 0; y < 3; y++)
        add_row(rows, NULL, (double[]){m[y][0], m[y][1], m[y][2], t[y]}, 4);
    add_row(rows, NULL, (double[]){0, 0, 0, 1}, 4);
    const struct covariance3 *c = &rig->error_at_1m;
    add_row(root, "error_at_1_m", (double[]){c->xx, c->xy, c->xz, c->yy, c->yz, c->zz}, 6);
    json_add_number(root, "width", rig->left.width);
    json_add_number(root, "height", rig->left.height);
    char *text = json_print(root);
    json_free(&root);
    return text;
}
