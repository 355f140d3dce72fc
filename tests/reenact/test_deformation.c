// A likeness is laid on a frame that its parts alone cannot follow: the trunk is fuller there, the forearms thinner.
#include "tests/support/painted_person.h"
#include "tests/support/test.h"

#include "reenact/avatar/avatar.h"
#include "reenact/avatar/deformation.h"

#include <string.h>

struct stage {
    struct painted_take take; // of the frame that is shown
    struct source_rays *rays;
    struct likeness likeness;
    struct sight sight;
    struct warp *warp;
    struct posture posture;
};

static void film(struct painted_take *out, const struct body *body, struct painted *seen)
{
    struct skeleton joints = whole_body(0);
    paint_person(seen, &ideal, &joints, body);
    struct one_frame frame = {joints, seen->rgb, seen->depth, seen->mask};
    painted_take_open(out, &ideal, &frame, 1, &whole_measures);
}

// A likeness of somebody, and a frame of that person with another body.
static void stage_open(struct stage *s, const struct body *body, struct painted *seen)
{
    struct painted_take first;
    struct skeleton joints = whole_body(0);
    film(&first, &whole_measures, seen);
    EXPECT_STATUS(source_rays_open(&s->rays, take_calibration(first.take)), OK);
    EXPECT_STATUS(likeness_make(&s->likeness, first.take, s->rays, 1, NULL), OK);
    painted_take_close(&first);
    film(&s->take, body, seen);
    const struct likeness *l = &s->likeness;
    EXPECT_STATUS(posture_of(&l->rest, &joints, &s->posture), OK);
    EXPECT_STATUS(warp_open(&s->warp, &l->rest, &l->surface, take_calibration(s->take.take)), OK);
    EXPECT_STATUS(sight_open(&s->sight, s->take.take, s->rays), OK);
    EXPECT_STATUS(sight_read(&s->sight, s->take.take, 0), OK);
}

static void stage_close(struct stage *s)
{
    sight_close(&s->sight);
    warp_close(&s->warp);
    likeness_free(&s->likeness);
    source_rays_close(&s->rays);
    painted_take_close(&s->take);
}

// The figure, warped, against a picture of the person: by how much it lies before or behind what is seen there, mean,
// and the share of what faces the camera that lies more than a pixel beside the person.
static void compare(const struct stage *s, const struct painted *seen, double *off_mm, double *beside)
{
    const struct likeness *l = &s->likeness;
    double sum = 0, on = 0, off = 0;
    for (int i = 0; i < l->surface.point_count; i++) {
        struct vec3 p, n, rest = l->surface.points[i];
        skin_place(&l->skins[i], &s->posture, v3_add(rest, warp_at(s->warp, rest)), l->surface.normals[i], &p, &n);
        if (-v3_dot(n, v3_unit(p)) < 0.1)
            continue;
        struct pixel px = lens_project(&ideal, p);
        int at = (int)(px.y + 0.5) * W + (int)(px.x + 0.5);
        bool near = false; // a sensor's edges are off by so much
        for (int k = 0; k < 9; k++)
            near |= seen->mask[at + (k / 3 - 1) * W + k % 3 - 1] != 0;
        off += !near;
        if (!seen->mask[at])
            continue;
        on++;
        sum += fabs(seen->depth[at] - 1000 * p.z);
    }
    *off_mm = sum / on;
    *beside = off / (on + off);
}

static void it_follows_what_parts_cannot(void **state)
{
    (void)state;
    static struct painted seen;
    struct stage s;
    struct body body = whole_measures;
    body.radius_rate[PART_UPPER_TORSO] *= 1.15;
    body.radius_rate[PART_LOWER_TORSO] *= 1.15;
    body.radius_rate[PART_LEFT_FOREARM] *= 0.7;
    body.radius_rate[PART_RIGHT_FOREARM] *= 0.7;
    stage_open(&s, &body, &seen);
    double before_mm, after_mm, beside_before, beside_after;
    compare(&s, &seen, &before_mm, &beside_before);
    const struct warp_model model = {s.likeness.volume, &s.likeness.surface, s.likeness.skins};
    warp_fit(s.warp, &model, &s.sight, &s.posture, NULL);
    compare(&s, &seen, &after_mm, &beside_after);
    print_message("off by %.1f mm, warped %.1f mm; beside the person %.2f %%, warped %.2f %%\n", before_mm, after_mm,
                  100 * beside_before, 100 * beside_after);
    EXPECT_AT_MOST(after_mm, before_mm / 2);
    EXPECT_AT_MOST(beside_after, beside_before / 2);
    stage_close(&s);
}

// On the frame that the figure was made of there is next to nothing to do; nothing at all where no one is seen.
static void it_leaves_alone_what_fits(void **state)
{
    (void)state;
    static struct painted seen;
    struct stage s;
    stage_open(&s, &whole_measures, &seen);
    const struct warp_model model = {s.likeness.volume, &s.likeness.surface, s.likeness.skins};
    warp_fit(s.warp, &model, &s.sight, &s.posture, NULL);
    double mean = 0, most = 0;
    for (int i = 0; i < s.likeness.surface.point_count; i++) {
        double shift = v3_length(warp_at(s.warp, s.likeness.surface.points[i]));
        mean += shift / s.likeness.surface.point_count;
        most = fmax(most, shift);
    }
    print_message("shifted by %.1f mm, at most %.1f mm\n", 1000 * mean, 1000 * most);
    EXPECT_AT_MOST(1000 * mean, 5);
    EXPECT_AT_LEAST(1000 * most, 0.1);
    memset(s.sight.part, SIGHT_ROOM, (size_t)s.sight.width * (size_t)s.sight.height);
    warp_fit(s.warp, &model, &s.sight, &s.posture, NULL);
    most = 0;
    for (int i = 0; i < s.likeness.surface.point_count; i++)
        most = fmax(most, v3_length(warp_at(s.warp, s.likeness.surface.points[i])));
    EXPECT_NEAR(most, 0, 1e-9);
    stage_close(&s);
}

// Bands across the trunk, by height in the rest pose; 0 to 1.
static double band(double y) { return 0.5 + 0.4 * sin(2 * 3.14159265358979 * y / 0.1); }

// The figure's trunk is known to have bands, and nothing is known of the rest of it.
static void know_bands(struct likeness *l)
{
    l->coat.light = (struct light){{1}};
    for (int i = 0; i < l->surface.point_count; i++) {
        const double color = band(l->surface.points[i].y);
        l->coat.filled[i] = l->skins[i].bone[0] != PART_UPPER_TORSO;
        for (int c = 0; c < 3; c++)
            l->coat.color[i][c] = (float)(color * color);
    }
}

// The picture has them so much lower, as cloth slides, and it is darker.
static void paint_bands(const struct stage *s, double lower_m, struct painted *seen)
{
    const struct pose rest_from_color = pose_inverse(s->posture.bone[PART_UPPER_TORSO]);
    for (int i = 0; i < PIXELS; i++) {
        if (s->sight.part[i] >= PART_COUNT)
            continue;
        const struct vec3 p = v3_scale(lens_ray(&ideal, (struct pixel){i % W, i / W}), seen->depth[i] * 1e-3);
        memset(seen->rgb + 3 * i, (int)(0.8 * 255 * band(pose_apply(rest_from_color, p).y - lower_m)), 3);
    }
}

// How far down the trunk's front is shifted, mean.
static double shifted_down(const struct stage *s)
{
    double sum = 0, count = 0;
    for (int i = 0; i < s->likeness.surface.point_count; i++)
        if (s->likeness.skins[i].bone[0] == PART_UPPER_TORSO && s->likeness.surface.normals[i].z < -0.5) {
            sum += warp_at(s->warp, s->likeness.surface.points[i]).y;
            count++;
        }
    return sum / count;
}

static void it_follows_cloth_that_slides(void **state)
{
    (void)state;
    static struct painted seen;
    const double lower_m = 0.012;
    struct stage s;
    stage_open(&s, &whole_measures, &seen);
    know_bands(&s.likeness);
    paint_bands(&s, lower_m, &seen);
    const struct warp_model model = {s.likeness.volume, &s.likeness.surface, s.likeness.skins};
    const struct warp_colors colors = {&s.likeness.coat, seen.rgb, take_calibration(s.take.take),
                                       POSE_IDENTITY.rotation};
    warp_fit(s.warp, &model, &s.sight, &s.posture, NULL);
    const double blind_m = shifted_down(&s);
    warp_fit(s.warp, &model, &s.sight, &s.posture, &colors);
    const double found_m = shifted_down(&s);
    print_message("slid by %.1f mm; by its shape alone %.1f mm, by its colours %.1f mm\n", 1e3 * lower_m, 1e3 * blind_m,
                  1e3 * found_m);
    EXPECT_NEAR(found_m, lower_m, 0.003);
    EXPECT_AT_MOST(fabs(blind_m), 0.002);
    stage_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_follows_what_parts_cannot),
        cmocka_unit_test(it_leaves_alone_what_fits),
        cmocka_unit_test(it_follows_cloth_that_slides),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
