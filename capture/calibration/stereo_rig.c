#include "capture/calibration/stereo_rig.h"

#include "platform/files/image_file.h"
#include "platform/files/json.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
