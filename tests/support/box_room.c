#include "tests/support/test.h"

#include "tests/support/box_room.h"

#include <stdlib.h>

struct pose room_camera(double x, double y, double z)
{
    double level[3][3] = {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}}; // looks along x
    return (struct pose){quat_from_matrix(level), v3(x, y, z)};
}

void room_add_box(struct box_world *w, struct vec3 low, struct vec3 high, bool inside)
{
    w->boxes[w->count++] = (struct box){
        .low = {low.x, low.y, low.z}, .high = {high.x, high.y, high.z}, .color = {150, 120, 100}, .inside = inside};
}

void room_picture(const struct box_world *w, struct pose pose, struct surround_picture *p)
{
    uint8_t *rgb = malloc(ROOM_WIDTH * ROOM_HEIGHT * 3);
    box_world_panorama(w, pose, ROOM_WIDTH, ROOM_HEIGHT, rgb);
    assert_int_equal(surround_picture_make(p, rgb, ROOM_WIDTH, ROOM_HEIGHT, NULL), OK);
    surround_picture_place(p, pose);
    p->inverse = malloc(ROOM_WIDTH * ROOM_HEIGHT * sizeof *p->inverse);
    p->joined = malloc(ROOM_WIDTH * ROOM_HEIGHT);
    for (int v = 0; v < ROOM_HEIGHT; v++)
        for (int u = 0; u < ROOM_WIDTH; u++) {
            float ray[3];
            surround_picture_ray(p, u, v, ray);
            const struct vec3 d = quat_rotate(pose.rotation, v3(ray[0], ray[1], ray[2]));
            const double from[3] = {pose.translation.x, pose.translation.y, pose.translation.z};
            p->inverse[v * ROOM_WIDTH + u] = (float)(1 / box_world_cast(w, from, (double[3]){d.x, d.y, d.z}, NULL));
        }
    surround_picture_join(p);
}

void box_room_make_truth(struct box_room *s, struct pose eye)
{
    const struct lens *lens = &s->view.lens;
    for (int i = 0; i < lens->width * lens->height; i++) {
        const struct vec3 c = v3_unit(lens_ray(lens, (struct pixel){i % lens->width, i / lens->width}));
        const struct vec3 d = quat_rotate(eye.rotation, c);
        const double from[3] = {eye.translation.x, eye.translation.y, eye.translation.z};
        s->depth[i] = c.z * box_world_cast(&s->world, from, (double[3]){d.x, d.y, d.z}, s->truth + 3 * i);
    }
}

void box_room_open(struct box_room *s, const struct lens *view)
{
    *s = (struct box_room){.truth = malloc((size_t)view->width * (size_t)view->height * 3),
                           .depth = malloc((size_t)view->width * (size_t)view->height * sizeof *s->depth)};
    assert_true(s->truth && s->depth);
    room_add_box(&s->world, v3(-2, -2, 0), v3(4, 2, 2.5), true);
    room_add_box(&s->world, v3(1.5, -0.3, 0), v3(1.8, 0.3, 1), false);
    assert_int_equal(surround_view_open(&s->view, view), OK);
}

void box_room_film(struct box_room *s)
{
    for (int i = 0; i < ROOM_PICTURES; i++) {
        room_picture(&s->world, room_camera(0.4 * i - 0.4, 0.3 * i - 0.3, 1.15), &s->pictures[i]);
        s->pictures[i].depth_number = i + 1;
    }
}

void box_room_close(struct box_room *s)
{
    for (int i = 0; i < ROOM_PICTURES; i++)
        surround_picture_free(&s->pictures[i]);
    surround_view_close(&s->view);
    free(s->truth);
    free(s->depth);
}

void box_room_draw(struct box_room *s, struct pose eye, int count)
{
    const struct surround_picture *list[ROOM_PICTURES];
    const struct view_options options = view_default_options();
    for (int i = 0; i < count; i++)
        list[i] = &s->pictures[i];
    assert_int_equal(surround_view_rank(eye, list, count), OK);
    assert_int_equal(surround_view_draw(&s->view, eye, list, count, &options), OK);
    box_room_make_truth(s, eye);
}

struct room_plate box_room_put_plate(struct box_room *s, struct pose eye)
{
    const struct vec3 low = v3(0.6, -0.42, 1.2), high = v3(0.6, -0.18, 1.4); // facing the way
    const struct lens *lens = &s->view.lens;
    const struct pose view_from_world = pose_inverse(eye);
    const struct pixel a = lens_project(lens, pose_apply(view_from_world, v3(low.x, high.y, high.z)));
    const struct pixel b = lens_project(lens, pose_apply(view_from_world, v3(low.x, low.y, low.z)));
    for (int i = 0; i < ROOM_PICTURES; i++) {
        struct surround_picture *p = &s->pictures[i];
        const struct vec3 c = p->world_from_camera.translation;
        for (int k = 0; k < ROOM_WIDTH * ROOM_HEIGHT; k++) {
            float ray[3];
            surround_picture_ray(p, k % ROOM_WIDTH, k / ROOM_WIDTH, ray);
            const struct vec3 d = quat_rotate(p->world_from_camera.rotation, v3(ray[0], ray[1], ray[2]));
            const struct vec3 seen = v3_add(c, v3_scale(d, 1 / (double)p->inverse[k]));
            const struct vec3 plate = v3_add(c, v3_scale(d, (low.x - c.x) / d.x)),
                              from = pose_apply(view_from_world, seen);
            const struct pixel at = lens_project(lens, from);
            if (i == 0 && d.x > 0 && plate.y > low.y && plate.y < high.y && plate.z > low.z && plate.z < high.z)
                p->inverse[k] = (float)(d.x / (low.x - c.x));
            else if (from.z > 0 && at.x > a.x - 4 && at.x < b.x + 4 && at.y > a.y - 4 && at.y < b.y + 4)
                p->inverse[k] = DEPTH_UNKNOWN;
        }
        surround_picture_join(p);
    }
    return (struct room_plate){(int)a.x + 2, (int)a.y + 2, (int)b.x - 1, (int)b.y - 1};
}

struct room_measured box_room_measure(const struct box_room *s)
{
    const int pixels = s->view.lens.width * s->view.lens.height;
    double sum = 0, drawn = 0, off = 0;
    for (int i = 0; i < pixels; i++) {
        if (s->view.source[i] == SOURCE_UNSEEN)
            continue;
        drawn++;
        off += fabs(1 / (double)s->view.inverse_z[i] - s->depth[i]) > 0.03 * s->depth[i];
        for (int c = 0; c < 3; c++)
            sum += pow(s->view.rgb[3 * i + c] - s->truth[3 * i + c], 2);
    }
    const struct room_measured m = {10 * log10(255 * 255 / (sum / (3 * drawn))), drawn / pixels, off / drawn};
    print_message("%.1f dB, drawn %.3f, depth off %.4f\n", m.psnr_db, m.drawn, m.depth_off);
    return m;
}
