#include "tests/support/telephone_film.h"

#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "platform/files/video.h"
#include "tests/support/zip_writer.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { W = TELEPHONE_WIDTH, H = TELEPHONE_HEIGHT, DW = TELEPHONE_DEPTH_WIDTH, DH = TELEPHONE_DEPTH_HEIGHT };
enum { SAMPLES = DW * DH };

struct shot {
    double time_s;
    struct pose world_from_camera; // by the telephone's odometry, z up
    uint8_t *rgb, *jpeg;
    size_t jpeg_bytes;
    uint16_t mm[SAMPLES]; // as measured: with what has low confidence
    uint8_t confidence[SAMPLES];
};

struct telephone_film {
    struct lens color, depth;
    struct shot *shots;
    int count;
    double step_s;
};

static void check(bool done)
{
    if (!done) {
        fprintf(stderr, "filming as a telephone failed: %s\n", status_message());
        abort();
    }
}

// ---------------------------------------------------------------- shooting

static struct pose drifted(struct pose pose, double share, double lean_rad)
{
    const struct pose elsewhere = {quat_from_rotation_vector(v3(0, 0, 1 + share * 0.0175)),
                                   v3(3, -2 + 0.03 * share, 1)};
    const struct pose lean = {quat_from_rotation_vector(v3(lean_rad, 0, 0)), v3(0, 0, 0)};
    return pose_multiply(elsewhere, pose_multiply(lean, pose));
}

static void shoot(struct telephone_film *film, const struct world *world, const struct telephone_shooting *shooting,
                  int i)
{
    struct shot *shot = &film->shots[i];
    shot->time_s = shooting->first_s + i * shooting->step_s;
    const struct pose camera = shooting->sweep ? world_sweep_pose(world, shot->time_s) : world_sensor_pose(world);
    struct world_shot seen = {film->color, camera, shot->time_s, !shooting->sweep};
    shot->world_from_camera = drifted(camera, (double)i / film->count, shooting->lean_rad);
    shot->rgb = malloc(3 * W * H);
    check(shot->rgb && world_render(world, &seen, &(struct world_image){.color = shot->rgb}) == OK);
    check(jpeg_encode(shot->rgb, W, H, 92, &shot->jpeg, &shot->jpeg_bytes) == OK);
    seen.lens = film->depth;
    check(world_render(world, &seen, &(struct world_image){.depth = shot->mm}) == OK);
    for (int k = 0; k < SAMPLES; k++) {
        const bool low = (k % DW / 8 + k / DW / 8) % 20 == 0;
        shot->confidence[k] = low ? 0 : 1 + k % 2;
        shot->mm[k] = low ? (uint16_t)(700 + k % 99) : shot->mm[k];
        if (k / DW >= DH - shooting->blind_rows)
            shot->mm[k] = 0;
    }
}

struct telephone_film *telephone_film_shoot(const struct world *world, const struct telephone_shooting *shooting)
{
    struct telephone_film *film = calloc(1, sizeof *film);
    check(film && (film->shots = calloc((size_t)shooting->frames, sizeof *film->shots)));
    film->color = world_calibration((double)W / 640).color;
    film->depth = world_calibration((double)DW / 640).depth;
    film->count = shooting->frames;
    film->step_s = shooting->step_s;
    for (int i = 0; i < film->count; i++)
        shoot(film, world, shooting, i);
    return film;
}

void telephone_film_free(struct telephone_film *film)
{
    for (int i = 0; i < film->count; i++) {
        free(film->shots[i].rgb);
        free(film->shots[i].jpeg);
    }
    free(film->shots);
    free(film);
}

// ---------------------------------------------------------------- as a folder

static void write_lens(char *out, const struct lens *l)
{
    sprintf(out, "{\"width\": %d, \"height\": %d, \"fx\": %.9g, \"fy\": %.9g, \"cx\": %.9g, \"cy\": %.9g}", l->width,
            l->height, l->fx, l->fy, l->cx, l->cy);
}

static void write_depth(const struct scratch *scratch, const char *path, const uint16_t *mm, const int size[2])
{
    uint8_t *bytes;
    size_t count;
    check(png_encode(&(struct png_layout){PNG_GRAY16, size[0], size[1]}, mm, 1, &bytes, &count) == OK);
    scratch_write(scratch, path, bytes, count);
    free(bytes);
}

void telephone_film_as_tum(const struct telephone_film *film, const struct scratch *scratch, const char *name)
{
    char path[300], text[1200], color[300], depth[300];
    static uint16_t mm[SAMPLES];
    char *lists[2] = {calloc(64, (size_t)film->count), calloc(64, (size_t)film->count)};
    check(lists[0] && lists[1]);
    write_lens(color, &film->color);
    write_lens(depth, &film->depth);
    snprintf(text, sizeof text, "{\"color\": %s, \"depth\": %s, \"registered\": true}", color, depth);
    snprintf(path, sizeof path, "%s/calibration.json", name);
    scratch_text(scratch, path, text);
    for (int i = 0; i < film->count; i++) {
        const struct shot *shot = &film->shots[i];
        snprintf(path, sizeof path, "%s/rgb/%04d.jpg", name, i);
        scratch_write(scratch, path, shot->jpeg, shot->jpeg_bytes);
        for (int k = 0; k < SAMPLES; k++)
            mm[k] = shot->confidence[k] ? shot->mm[k] : 0;
        snprintf(path, sizeof path, "%s/depth/%04d.png", name, i);
        write_depth(scratch, path, mm, (const int[2]){DW, DH});
        sprintf(lists[0] + strlen(lists[0]), "%.6f rgb/%04d.jpg\n", shot->time_s, i);
        sprintf(lists[1] + strlen(lists[1]), "%.6f depth/%04d.png\n", shot->time_s, i);
    }
    for (int k = 0; k < 2; k++) {
        snprintf(path, sizeof path, "%s/%s", name, k ? "depth.txt" : "rgb.txt");
        scratch_text(scratch, path, lists[k]);
        free(lists[k]);
    }
}

// ---------------------------------------------------------------- ARKit's axes

// World x, z, -y of ours are ARKit's x, y, z.
static struct vec3 in_arkit(struct vec3 p) { return v3(p.x, p.z, -p.y); }

// The rotation of a camera whose three axes are these directions of the picture's right, down and forward.
static struct quat axes_in_arkit(struct pose world_from_camera, const struct vec3 axes[3])
{
    double m[3][3];
    for (int k = 0; k < 3; k++) {
        const struct vec3 column = in_arkit(quat_rotate(world_from_camera.rotation, axes[k]));
        m[0][k] = column.x;
        m[1][k] = column.y;
        m[2][k] = column.z;
    }
    return quat_from_matrix(m);
}

// ---------------------------------------------------------------- as .r3d

static uint8_t *as_plain_lzfse(const void *bytes, size_t count, size_t *packed)
{
    uint8_t *out = malloc(count + 12);
    check(out != NULL);
    memcpy(out, "bvx-", 4);
    for (int i = 0; i < 4; i++)
        out[4 + i] = (uint8_t)(count >> 8 * i);
    memcpy(out + 8, bytes, count);
    memcpy(out + 8 + count, "bvx$", 4);
    *packed = count + 12;
    return out;
}

static void add_packed(struct zip_writer *zip, const char *name, const void *bytes, size_t count)
{
    size_t packed;
    uint8_t *out = as_plain_lzfse(bytes, count, &packed);
    zip_writer_add(zip, name, out, packed, false);
    free(out);
}

static char *metadata_text(const struct telephone_film *film)
{
    const struct lens *l = &film->color;
    char *text = malloc(1000 + 300 * (size_t)film->count), *at = text;
    check(text != NULL);
    // By columns, from the image's corner.
    at += sprintf(at,
                  "{\"w\": %d, \"h\": %d, \"dw\": %d, \"dh\": %d, \"fps\": 30, "
                  "\"K\": [%.9g, 0, 0, 0, %.9g, 0, %.9g, %.9g, 1], \"poses\": [",
                  W, H, DW, DH, l->fx, l->fy, l->cx + 0.5, l->cy + 0.5);
    for (int i = 0; i < film->count; i++) {
        const struct pose pose = film->shots[i].world_from_camera;
        const struct quat q = axes_in_arkit(pose, (const struct vec3[3]){{1, 0, 0}, {0, -1, 0}, {0, 0, -1}});
        const struct vec3 t = in_arkit(pose.translation);
        at += sprintf(at, "%s[%.9g, %.9g, %.9g, %.9g, %.9g, %.9g, %.9g]", i ? ", " : "", q.x, q.y, q.z, q.w, t.x, t.y,
                      t.z);
    }
    at += sprintf(at, "], \"frameTimestamps\": [");
    for (int i = 0; i < film->count; i++)
        at += sprintf(at, "%s%.6f", i ? ", " : "", film->shots[i].time_s);
    sprintf(at, "]}");
    return text;
}

void telephone_film_as_record3d(const struct telephone_film *film, const struct scratch *scratch, const char *name)
{
    struct zip_writer zip = {.count = 0};
    static float metres[SAMPLES];
    char member[64], *text = metadata_text(film);
    zip_writer_add(&zip, "metadata", text, strlen(text), true);
    free(text);
    for (int i = 0; i < film->count; i++) {
        const struct shot *shot = &film->shots[i];
        for (int k = 0; k < SAMPLES; k++)
            metres[k] = shot->mm[k] ? (float)(1e-3 * shot->mm[k]) : NAN;
        sprintf(member, "rgbd/%d.jpg", i);
        zip_writer_add(&zip, member, shot->jpeg, shot->jpeg_bytes, false);
        sprintf(member, "rgbd/%d.depth", i);
        add_packed(&zip, member, metres, sizeof metres);
        sprintf(member, "rgbd/%d.conf", i);
        add_packed(&zip, member, shot->confidence, sizeof shot->confidence);
    }
    zip_writer_end(&zip);
    scratch_write(scratch, name, zip.bytes, zip.count);
    zip_writer_free(&zip);
}

// ---------------------------------------------------------------- as Stray Scanner's

// A pixel of an image that lies on its side, its top to the left: the upright image's (x, y).
static size_t upright_index(bool on_side, int width, int height, int x, int y)
{
    return on_side ? (size_t)x * (size_t)height + (size_t)(height - 1 - y) : (size_t)y * (size_t)width + (size_t)x;
}

static void write_film(const struct telephone_film *film, const struct scratch *scratch, const char *path, bool on_side)
{
    const int width = on_side ? H : W, height = on_side ? W : H;
    uint8_t *rgb = malloc(3 * W * H);
    scratch_text(scratch, path, "");
    FILE *file = fopen(scratch_file(scratch, path), "w+b");
    struct video_writer *writer;
    check(rgb && file && video_open(&writer, file, &(struct video_layout){width, height, true}) == OK);
    for (int i = 0; i < film->count; i++) {
        for (int k = 0; k < W * H; k++)
            memcpy(rgb + 3 * k, film->shots[i].rgb + 3 * upright_index(on_side, width, height, k % width, k / width),
                   3);
        check(video_add(writer, rgb, (int64_t)(1e9 * (film->shots[i].time_s - film->shots[0].time_s))) == OK);
    }
    check(video_close(&writer, OK) == OK);
    fclose(file);
    free(rgb);
}

static void write_pictures(const struct shot *shot, const struct scratch *scratch, const char *name, int number,
                           bool on_side)
{
    const int width = on_side ? DH : DW, height = on_side ? DW : DH;
    static uint16_t mm[SAMPLES];
    static uint8_t confidence[SAMPLES];
    uint8_t *bytes;
    size_t count;
    char path[300];
    for (int k = 0; k < SAMPLES; k++) {
        const size_t from = upright_index(on_side, width, height, k % width, k / width);
        mm[k] = shot->mm[from];
        confidence[k] = shot->confidence[from];
    }
    snprintf(path, sizeof path, "%s/depth/%06d.png", name, number);
    write_depth(scratch, path, mm, (const int[2]){width, height});
    check(png_encode(&(struct png_layout){PNG_GRAY8, width, height}, confidence, 1, &bytes, &count) == OK);
    snprintf(path, sizeof path, "%s/confidence/%06d.png", name, number);
    scratch_write(scratch, path, bytes, count);
    free(bytes);
}

void telephone_film_as_stray(const struct telephone_film *film, const struct scratch *scratch, const char *name,
                             bool on_side)
{
    // Of a picture whose top is to the left, right is down in the room, and down is to the left.
    static const struct vec3 upright[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                             side[3] = {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}};
    const struct lens *l = &film->color;
    char path[300], text[400], *rows = calloc(300, (size_t)film->count + 1), *at = rows;
    check(rows != NULL);
    at += sprintf(at, "timestamp, frame, x, y, z, qx, qy, qz, qw\n");
    for (int i = 0; i < film->count; i++) {
        const struct pose pose = film->shots[i].world_from_camera;
        const struct quat q = axes_in_arkit(pose, on_side ? side : upright);
        const struct vec3 t = in_arkit(pose.translation);
        at += sprintf(at, "%.6f, %06d, %.9g, %.9g, %.9g, %.9g, %.9g, %.9g, %.9g\n", film->shots[i].time_s, i, t.x, t.y,
                      t.z, q.x, q.y, q.z, q.w);
        write_pictures(&film->shots[i], scratch, name, i, on_side);
    }
    snprintf(path, sizeof path, "%s/odometry.csv", name);
    scratch_text(scratch, path, rows);
    free(rows);
    snprintf(text, sizeof text, "%.9g, 0.0, %.9g\n0.0, %.9g, %.9g\n0.0, 0.0, 1.0\n", on_side ? l->fy : l->fx,
             (on_side ? l->cy : l->cx) + 0.5, on_side ? l->fx : l->fy, (on_side ? W - 1 - l->cx : l->cy) + 0.5);
    snprintf(path, sizeof path, "%s/camera_matrix.csv", name);
    scratch_text(scratch, path, text);
    snprintf(path, sizeof path, "%s/rgb.mp4", name);
    write_film(film, scratch, path, on_side);
}
