#include "tests/support/robot_film.h"

#include "platform/files/png.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FACE = 512, DEPTH_W = 160, DEPTH_H = 120, DEPTH_CAMERAS = 4 };
static const double PI = 3.14159265358979323846, DEPTH_UP_M = 0.9;

const struct pose robot_truth = {{0, 0, 0.867423226, 0.497571048}, {0.4, -0.7, 0}};
const struct pose robot_world_from_body[ROBOT_CAPTURES] = {{{0, 0, 0, 1}, {0, 0, 0}}, {{0, 0, 0, 1}, {0.8, 0.3, 0}}};
const struct pose robot_body_from_head = {{-0.5, 0.5, -0.5, 0.5}, {0, 0, 1.2}};
const struct lens robot_view = {.width = 640, .height = 480, .fx = 400, .fy = 400, .cx = 319.5, .cy = 239.5};

static void check(enum status status)
{
    if (status != OK) {
        fprintf(stderr, "the robot's film failed: %s\n", status_message());
        abort();
    }
}

// Of six pictures, each of a quarter circle: ahead, right, back, left, up, down.
struct surround_picture robot_panorama(const struct world *w, int capture)
{
    static uint8_t faces[6][FACE * FACE * 3];
    enum { HEIGHT = ROBOT_PANORAMA };
    const struct pose world_from_head = pose_multiply(robot_world_from_body[capture], robot_body_from_head);
    const struct vec3 turns[6] = {{0, 0, 0},       {0, PI / 2, 0}, {0, PI, 0},
                                  {0, -PI / 2, 0}, {PI / 2, 0, 0}, {-PI / 2, 0, 0}};
    const double middle = (FACE - 1) / 2.0;
    const struct lens lens = {
        .width = FACE, .height = FACE, .fx = FACE / 2.0, .fy = FACE / 2.0, .cx = middle, .cy = middle};
    struct pose camera_from_face[6];
    for (int k = 0; k < 6; k++) {
        camera_from_face[k] = (struct pose){quat_from_rotation_vector(turns[k]), v3(0, 0, 0)};
        const struct pose room_from_face =
            pose_multiply(robot_truth, pose_multiply(world_from_head, camera_from_face[k]));
        const struct world_shot shot = {lens, room_from_face, 0, false};
        check(world_render(w, &shot, &(struct world_image){.color = faces[k]}));
    }
    uint8_t *rgb = malloc((size_t)HEIGHT * 2 * HEIGHT * 3);
    if (!rgb)
        abort();
    for (int i = 0; i < 2 * HEIGHT * HEIGHT; i++) {
        const double lon = (i % (2 * HEIGHT) + 0.5) / HEIGHT * PI - PI, down = (i / (2 * HEIGHT) + 0.5) / HEIGHT * PI;
        const struct vec3 ray = v3(sin(down) * sin(lon), -cos(down), sin(down) * cos(lon));
        for (int k = 0; k < 6; k++) {
            const struct vec3 at = pose_apply(pose_inverse(camera_from_face[k]), ray);
            if (at.z < fabs(at.x) - 1e-9 || at.z < fabs(at.y) - 1e-9)
                continue;
            const struct pixel px = lens_project(&lens, at);
            const int x = (int)fmin(fmax(px.x + 0.5, 0), FACE - 1), y = (int)fmin(fmax(px.y + 0.5, 0), FACE - 1);
            memcpy(rgb + 3 * (size_t)i, faces[k] + 3 * (y * FACE + x), 3);
            break;
        }
    }
    struct surround_picture p;
    check(surround_picture_make(&p, rgb, 2 * HEIGHT, HEIGHT, NULL));
    surround_picture_place(&p, world_from_head);
    return p;
}

// ---------------------------------------------------------------- a folder

static const char *const sides[DEPTH_CAMERAS] = {"front", "left", "back", "right"};
static const struct lens depth_lens = {
    .width = DEPTH_W, .height = DEPTH_H, .fx = 75, .fy = 75, .cx = 79.5, .cy = 59.5}; // more than a quarter circle

static struct pose body_from_depth(int side)
{
    const struct pose turn = {quat_from_rotation_vector(v3(0, 0, side * PI / 2)), v3(0, 0, 0)};
    return pose_multiply(turn, (struct pose){robot_body_from_head.rotation, v3(0, 0, DEPTH_UP_M)});
}

static int print_camera(char *out, size_t room, const struct lens *l, struct pose body_from_camera)
{
    const struct vec3 t = body_from_camera.translation;
    const double shift[3] = {t.x, t.y, t.z};
    double m[3][3];
    quat_to_matrix(body_from_camera.rotation, m);
    int n = snprintf(out, room,
                     "\"width\": %d, \"height\": %d, \"fx\": %g, \"fy\": %g, \"cx\": %g, \"cy\": %g, "
                     "\"body_from_camera\": [",
                     l->width, l->height, l->fx, l->fy, l->cx, l->cy);
    for (int i = 0; i < 3; i++)
        n += snprintf(out + n, room - (size_t)n, "[%.12g, %.12g, %.12g, %g], ", m[i][0], m[i][1], m[i][2], shift[i]);
    return n + snprintf(out + n, room - (size_t)n, "[0, 0, 0, 1]]");
}

static void write_calibration(const struct scratch *scratch, const char *name, bool depth)
{
    char text[4096], path[64], camera[600];
    const struct lens *v = &robot_view;
    int n =
        snprintf(text, sizeof text,
                 "{\"body\": {\"length_m\": %g, \"width_m\": %g, \"height_m\": %g}, "
                 "\"view\": {\"width\": %d, \"height\": %d, \"fx\": %g, \"fy\": %g, \"cx\": %g, \"cy\": %g}, "
                 "\"panorama\": {\"projection\": \"equirectangular\", \"body_from_camera\": "
                 "[[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]]}, \"depth\": {",
                 ROBOT_SIZE_M[0], ROBOT_SIZE_M[1], ROBOT_SIZE_M[2], v->width, v->height, v->fx, v->fy, v->cx, v->cy);
    for (int side = 0; side < DEPTH_CAMERAS && depth; side++) {
        print_camera(camera, sizeof camera, &depth_lens, body_from_depth(side));
        n += snprintf(text + n, sizeof text - (size_t)n, "%s\"%s\": {%s}", side ? ", " : "", sides[side], camera);
    }
    snprintf(text + n, sizeof text - (size_t)n, "}}");
    snprintf(path, sizeof path, "%s/calibration.json", name);
    scratch_text(scratch, path, text);
}

static void film_depth(const struct scratch *scratch, const char *name, const struct world *w, int side)
{
    static uint16_t depth[DEPTH_W * DEPTH_H];
    char list[256] = "", path[64];
    for (int i = 0; i < ROBOT_CAPTURES; i++) {
        const struct pose world_from_depth = pose_multiply(robot_world_from_body[i], body_from_depth(side));
        const struct world_shot shot = {depth_lens, pose_multiply(robot_truth, world_from_depth), 0, false};
        check(world_render(w, &shot, &(struct world_image){.depth = depth}));
        snprintf(path, sizeof path, "%s/%s%d.png", name, sides[side], i);
        check(png_write(scratch_file(scratch, path), PNG_GRAY16, depth, DEPTH_W, DEPTH_H));
        sprintf(list + strlen(list), "%d.0 %s%d.png\n", 10 + i, sides[side], i);
    }
    snprintf(path, sizeof path, "%s/depth_%s.txt", name, sides[side]);
    scratch_text(scratch, path, list);
}

void robot_film(const struct scratch *scratch, const char *name, const struct surround_picture *panoramas,
                const struct world *depth)
{
    char pictures[256] = "", odometry[512] = "", path[64];
    write_calibration(scratch, name, depth);
    for (int i = 0; i < ROBOT_CAPTURES; i++) {
        const struct pose p = robot_world_from_body[i];
        sprintf(pictures + strlen(pictures), "%d.0 %d.png\n", 10 + i, i);
        sprintf(odometry + strlen(odometry), "%d.0 %g %g %g %g %g %g %g\n", 10 + i, p.translation.x, p.translation.y,
                p.translation.z, p.rotation.x, p.rotation.y, p.rotation.z, p.rotation.w);
        snprintf(path, sizeof path, "%s/%d.png", name, i);
        scratch_text(scratch, path, ""); // makes the folder
        check(png_write(scratch_file(scratch, path), PNG_RGB8, panoramas[i].rgb, panoramas[i].width,
                        panoramas[i].height));
    }
    snprintf(path, sizeof path, "%s/panorama.txt", name);
    scratch_text(scratch, path, pictures);
    snprintf(path, sizeof path, "%s/odometry.txt", name);
    scratch_text(scratch, path, odometry);
    for (int side = 0; side < DEPTH_CAMERAS && depth; side++)
        film_depth(scratch, name, depth, side);
}
