// Deformation of an avatar to frames that rigid bones cannot follow: a fuller trunk, thinner forearms, sliding cloth.
#include "tests/support/test.h"

#include "reenact/avatar/avatar.h"
#include "reenact/avatar/deformation.h"
#include "tests/support/observe.h"
#include "tests/support/painted_person.h"

#include <string.h>

struct deformation_case {
    struct painted_take take; // of the frame to fit
    struct source_rays *rays;
    struct avatar avatar;
    struct depth_frame observed;
    struct deformation *deformation;
    struct bone_transforms transforms;
};

static void film(struct painted_take *out, const struct body *body, struct painted *seen)
{
    struct skeleton joints = whole_body(0);
    paint_person(seen, &ideal, &joints, body);
    struct one_frame frame = {joints, seen->rgb, seen->depth, seen->mask};
    painted_take_open(out, &ideal, &frame, 1, &whole_measures);
}

// The avatar of a person, and a frame of that person with another body.
static void deformation_case_open(struct deformation_case *s, const struct body *body, struct painted *seen)
{
    struct painted_take first;
    struct skeleton joints = whole_body(0);
    film(&first, &whole_measures, seen);
    EXPECT_STATUS(source_rays_open(&s->rays, take_calibration(first.take)), OK);
    EXPECT_STATUS(avatar_make(&s->avatar, first.take, s->rays, &(struct avatar_options){.max_frames = 1, .threads = 4}),
                  OK);
    painted_take_close(&first);
    film(&s->take, body, seen);
    const struct avatar *l = &s->avatar;
    EXPECT_STATUS(bone_transforms_of(&l->bind_pose, &joints, &s->transforms), OK);
    EXPECT_STATUS(deformation_open(&s->deformation, &l->bind_pose, &l->surface, take_calibration(s->take.take)), OK);
    EXPECT_STATUS(depth_frame_open(&s->observed, s->take.take, s->rays), OK);
    EXPECT_STATUS(observe_frame(&s->observed, s->take.take, 0), OK);
}

static void deformation_case_close(struct deformation_case *s)
{
    depth_frame_close(&s->observed);
    deformation_close(&s->deformation);
    avatar_free(&s->avatar);
    source_rays_close(&s->rays);
    painted_take_close(&s->take);
}

// The deformed avatar against a frame. off_mm: its mean absolute depth error; beside: the share of the points facing
// the camera that project more than a pixel outside the person.
static void compare(const struct deformation_case *s, const struct painted *seen, double *off_mm, double *beside)
{
    const struct avatar *l = &s->avatar;
    double sum = 0, on = 0, off = 0;
    for (int i = 0; i < l->surface.point_count; i++) {
        struct vec3 p, n, bind_point = l->surface.points[i];
        linear_blend_skin(&l->skins[i], &s->transforms, v3_add(bind_point, deformation_at(s->deformation, bind_point)),
                          l->surface.normals[i], &p, &n);
        if (-v3_dot(n, v3_unit(p)) < 0.1)
            continue;
        struct pixel px = lens_project(&ideal, p);
        int at = (int)(px.y + 0.5) * W + (int)(px.x + 0.5);
        bool close = false; // within a pixel: the sensor's edges are no better
        for (int k = 0; k < 9; k++)
            close |= seen->mask[at + (k / 3 - 1) * W + k % 3 - 1] != 0;
        off += !close;
        if (!seen->mask[at])
            continue;
        on++;
        sum += fabs(seen->depth[at] - 1000 * p.z);
    }
    *off_mm = sum / on;
    *beside = off / (on + off);
}

static void test_deformation_follows_nonrigid_motion(void **state)
{
    (void)state;
    static struct painted seen;
    struct deformation_case s;
    struct body body = whole_measures;
    body.radius_rate[PART_UPPER_TORSO] *= 1.15;
    body.radius_rate[PART_LOWER_TORSO] *= 1.15;
    body.radius_rate[PART_LEFT_FOREARM] *= 0.7;
    body.radius_rate[PART_RIGHT_FOREARM] *= 0.7;
    deformation_case_open(&s, &body, &seen);
    double before_mm, after_mm, beside_before, beside_after;
    compare(&s, &seen, &before_mm, &beside_before);
    const struct deformation_model model = {s.avatar.tsdf, &s.avatar.surface, s.avatar.skins};
    deformation_fit(s.deformation, &model, &s.observed, &s.transforms, NULL);
    compare(&s, &seen, &after_mm, &beside_after);
    print_message("off by %.1f mm, deformed %.1f mm; beside the person %.2f %%, deformed %.2f %%\n", before_mm,
                  after_mm, 100 * beside_before, 100 * beside_after);
    EXPECT_AT_MOST(after_mm, before_mm * 0.4);         // measured 5.0 of 15.9 mm
    EXPECT_AT_MOST(beside_after, beside_before * 0.3); // measured 0.11 of 0.64 %
    deformation_case_close(&s);
}

// The frame that the avatar was made of needs hardly any deformation; a frame without the person gives none.
static void test_deformation_keeps_good_fit(void **state)
{
    (void)state;
    static struct painted seen;
    struct deformation_case s;
    deformation_case_open(&s, &whole_measures, &seen);
    const struct deformation_model model = {s.avatar.tsdf, &s.avatar.surface, s.avatar.skins};
    deformation_fit(s.deformation, &model, &s.observed, &s.transforms, NULL);
    double mean = 0, most = 0;
    for (int i = 0; i < s.avatar.surface.point_count; i++) {
        double shift = v3_length(deformation_at(s.deformation, s.avatar.surface.points[i]));
        mean += shift / s.avatar.surface.point_count;
        most = fmax(most, shift);
    }
    print_message("shifted by %.1f mm, at most %.1f mm\n", 1000 * mean, 1000 * most);
    EXPECT_AT_MOST(1000 * mean, 3);    // measured 1.8 mm
    EXPECT_AT_LEAST(1000 * most, 0.1); // measured 5.8 mm
    memset(s.observed.part, DEPTH_FRAME_BACKGROUND, (size_t)s.observed.width * (size_t)s.observed.height);
    deformation_fit(s.deformation, &model, &s.observed, &s.transforms, NULL);
    most = 0;
    for (int i = 0; i < s.avatar.surface.point_count; i++)
        most = fmax(most, v3_length(deformation_at(s.deformation, s.avatar.surface.points[i])));
    EXPECT_NEAR(most, 0, 1e-9);
    deformation_case_close(&s);
}

// The colour of bands across the trunk, by height in the bind pose; gamma-encoded, 0 to 1.
static double band(double y) { return 0.5 + 0.4 * sin(2 * 3.14159265358979 * y / 0.1); }

// Gives the avatar's trunk bands, and marks the rest as never seen.
static void set_bands(struct avatar *l)
{
    l->vertex_colors.irradiance = (struct sh_irradiance){{1}};
    for (int i = 0; i < l->surface.point_count; i++) {
        const double color = band(l->surface.points[i].y);
        l->vertex_colors.filled[i] = l->skins[i].bone[0] != PART_UPPER_TORSO;
        for (int c = 0; c < 3; c++)
            l->vertex_colors.color[i][c] = (float)(color * color);
    }
}

// Paints the bands lower, as cloth slides, and darker.
static void paint_bands(const struct deformation_case *s, double lower_m, struct painted *seen)
{
    const struct pose bind_from_color = pose_inverse(s->transforms.bone[PART_UPPER_TORSO]);
    for (int i = 0; i < PIXELS; i++) {
        if (s->observed.part[i] >= PART_COUNT)
            continue;
        const struct vec3 p = v3_scale(lens_ray(&ideal, (struct pixel){i % W, i / W}), seen->depth[i] * 1e-3);
        memset(seen->rgb + 3 * i, (int)(0.8 * 255 * band(pose_apply(bind_from_color, p).y - lower_m)), 3);
    }
}

// The mean downward shift of the trunk's front.
static double shifted_down(const struct deformation_case *s)
{
    double sum = 0, count = 0;
    for (int i = 0; i < s->avatar.surface.point_count; i++)
        if (s->avatar.skins[i].bone[0] == PART_UPPER_TORSO && s->avatar.surface.normals[i].z < -0.5) {
            sum += deformation_at(s->deformation, s->avatar.surface.points[i]).y;
            count++;
        }
    return sum / count;
}

static void test_deformation_follows_sliding_cloth(void **state)
{
    (void)state;
    static struct painted seen;
    const double lower_m = 0.012;
    struct deformation_case s;
    deformation_case_open(&s, &whole_measures, &seen);
    set_bands(&s.avatar);
    paint_bands(&s, lower_m, &seen);
    const struct deformation_model model = {s.avatar.tsdf, &s.avatar.surface, s.avatar.skins};
    const struct deformation_colors colors = {.albedo = (const float(*)[3])s.avatar.vertex_colors.color,
                                              .filled = s.avatar.vertex_colors.filled,
                                              .irradiance = &s.avatar.vertex_colors.irradiance,
                                              .rgb = seen.rgb,
                                              .calibration = take_calibration(s.take.take),
                                              .world_from_color = POSE_IDENTITY.rotation};
    deformation_fit(s.deformation, &model, &s.observed, &s.transforms, NULL);
    const double blind_m = shifted_down(&s);
    deformation_fit(s.deformation, &model, &s.observed, &s.transforms, &colors);
    const double found_m = shifted_down(&s);
    print_message("slid by %.1f mm; found from shape alone %.1f mm, with colours %.1f mm\n", 1e3 * lower_m,
                  1e3 * blind_m, 1e3 * found_m);
    EXPECT_NEAR(found_m, lower_m, 0.002); // measured 11.4 of 12.0 mm
    EXPECT_AT_MOST(fabs(blind_m), 0.001); // measured 0.0 mm
    deformation_case_close(&s);
}

// What a damaged file could ask for is refused before it is allocated; also where the points' number exceeds 32 bits.
static void test_the_grid_is_bounded(void **state)
{
    (void)state;
    static struct painted seen;
    struct deformation_case s;
    deformation_case_open(&s, &whole_measures, &seen);
    const struct deformation_grid person = deformation_grid_about(&s.avatar.surface);
    print_message("a standing person: %d x %d x %d points\n", person.size[0], person.size[1], person.size[2]);
    EXPECT_TRUE(deformation_grid_is_small(&s.avatar.surface));
    deformation_case_close(&s);

    struct vec3 points[2] = {{0, 0, 0}};
    const struct surface_mesh two = {.points = points, .point_count = 2};
    const double sides_m[] = {5.8, 6, 97, 199}; // 97: as a number of 32 bits the count is negative
    for (size_t i = 0; i < COUNT_OF(sides_m); i++) {
        points[1] = v3(sides_m[i], sides_m[i], sides_m[i]);
        const struct deformation_grid g = deformation_grid_about(&two);
        const int64_t count = (int64_t)g.size[0] * g.size[1] * g.size[2];
        print_message("%g m: %d points a side, %lld in all\n", sides_m[i], g.size[0], (long long)count);
        EXPECT_INT(deformation_grid_is_small(&two), count <= DEFORMATION_POINTS_MAX);
        EXPECT_INT(deformation_grid_is_small(&two), i == 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_deformation_follows_nonrigid_motion),
        cmocka_unit_test(test_deformation_keeps_good_fit),
        cmocka_unit_test(test_deformation_follows_sliding_cloth),
        cmocka_unit_test(test_the_grid_is_bounded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
