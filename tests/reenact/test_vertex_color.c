// Vertex colours of a drum that turns before the camera, painted and lit by functions that are known: albedo and
// irradiance come back apart, and a wrong frame changes neither.
#include "tests/support/test.h"

#include "reenact/avatar/vertex_color.h"

#include <stdio.h>

enum {
    WIDTH = 160,
    HEIGHT = 120,
    PIXELS = WIDTH * HEIGHT,
    AROUND = 64,
    DOWN = 30,
    POINTS = AROUND * DOWN,
    FRAMES = 24
};
#define PI       3.14159265358979323846
#define RADIUS_M 0.2
#define HIGH_M   0.5
#define AWAY_M   1.2

static const struct lens lens = {.width = WIDTH, .height = HEIGHT, .fx = 180, .fy = 180, .cx = 79.5, .cy = 59.5};

// The drum is one bone, the upper torso, along the bind pose's y axis.
struct drum {
    struct bind_pose bind_pose;
    struct vec3 point[POINTS], normal[POINTS];
    struct skin_weights skins[POINTS];
    struct surface_mesh surface;
    struct calibration calibration;
    struct deformation *deformation;
};

// One frame's images and where the drum is.
struct view {
    struct bone_transforms transforms;
    uint16_t depth[PIXELS];
    uint8_t part[PIXELS], edge_distance[PIXELS], half_width[PIXELS], rgb[3 * PIXELS];
    struct depth_frame frame;
};

static struct drum drum;
static struct view view;

static struct vec3 rim(double angle) { return v3(RADIUS_M * sin(angle), 0, -RADIUS_M * cos(angle)); }

static int make_drum(void **state)
{
    (void)state;
    struct bind_pose *b = &drum.bind_pose;
    const enum part part = PART_UPPER_TORSO;
    b->skeleton.joint[part_ends[part].to] = v3(0, HIGH_M, 0);
    b->skeleton.confidence[part_ends[part].from] = b->skeleton.confidence[part_ends[part].to] = 1;
    b->known[part] = true;
    b->radius[part] = RADIUS_M;
    b->own_length[part] = HIGH_M;
    b->frame[part] = (struct bone_frame){v3(0, 0, 0), v3(1, 0, 0), v3(0, 0, -1), v3(0, 1, 0), HIGH_M};
    for (int i = 0; i < POINTS; i++) {
        const double angle = 2 * PI * (i % AROUND) / AROUND;
        drum.normal[i] = v3_unit(rim(angle));
        drum.point[i] = v3_add(rim(angle), v3(0, HIGH_M * (i / AROUND + 0.5) / DOWN, 0));
        drum.skins[i] = (struct skin_weights){{PART_UPPER_TORSO}, {1}};
    }
    drum.surface = (struct surface_mesh){.points = drum.point, .normals = drum.normal, .point_count = POINTS};
    drum.calibration =
        (struct calibration){.color = lens, .depth = lens, .registered = true, .color_from_depth = POSE_IDENTITY};
    EXPECT_STATUS(deformation_open(&drum.deformation, b, &drum.surface, &drum.calibration), OK);
    return 0;
}

static int free_drum(void **state)
{
    (void)state;
    deformation_close(&drum.deformation);
    return 0;
}

// What is painted at an angle and a height: linear, smooth, another in each channel.
static double albedo_at(double angle, double down, int channel)
{
    return 0.3 + 0.12 * sin(2 * angle + channel) + 0.1 * cos(9 * down + 2 * channel);
}

// Light from the camera's upper right; its mean over the directions that are seen is not 1.
static double light_at(struct vec3 normal, double strength)
{
    return 1 + strength * v3_dot(normal, v3_unit(v3(1, -0.4, -0.6)));
}

// To the nearest pixel that does not show the drum, city block, in two sweeps.
static void find_edge_distances(void)
{
    for (int sweep = 0; sweep < 2; sweep++)
        for (int k = 0; k < PIXELS; k++) {
            const int i = sweep ? PIXELS - 1 - k : k, step = sweep ? 1 : -1, x = i % WIDTH, y = i / WIDTH;
            int least = view.part[i] == PART_UPPER_TORSO ? sweep ? view.edge_distance[i] : DEPTH_FRAME_MAX_EDGE_PX : 0;
            if (x + step >= 0 && x + step < WIDTH && view.edge_distance[i + step] + 1 < least)
                least = view.edge_distance[i + step] + 1;
            if (y + step >= 0 && y + step < HEIGHT && view.edge_distance[i + step * WIDTH] + 1 < least)
                least = view.edge_distance[i + step * WIDTH] + 1;
            view.edge_distance[i] = (uint8_t)least;
        }
}

// The drum turned by `turn` about its axis, lit, as the camera sees it.
static void film(double turn, double strength)
{
    const struct quat rotation = quat_from_rotation_vector(v3(0, turn, 0));
    const struct pose camera_from_bind = {rotation, {0, -HIGH_M / 2, AWAY_M}};
    memset(&view, 0, sizeof view);
    for (int b = 0; b < BONE_COUNT; b++)
        view.transforms.bone[b] = camera_from_bind;
    for (int i = 0; i < PIXELS; i++) {
        const struct vec3 ray = lens_ray(&lens, (struct pixel){i % WIDTH, i / WIDTH});
        const double a = ray.x * ray.x + 1, c = AWAY_M * AWAY_M - RADIUS_M * RADIUS_M, root = AWAY_M * AWAY_M - a * c;
        const double z = root > 0 ? (AWAY_M - sqrt(root)) / a : 0, down = ray.y * z + HIGH_M / 2;
        const bool seen = root > 0 && down > 0 && down < HIGH_M;
        view.part[i] = seen ? PART_UPPER_TORSO : DEPTH_FRAME_BACKGROUND;
        view.depth[i] = (uint16_t)lround(1000 * (seen ? z : 3));
        view.half_width[i] = seen ? 20 : 0;
        if (!seen)
            continue;
        const struct vec3 out = v3_scale(v3(ray.x * z, 0, z - AWAY_M), 1 / RADIUS_M);
        const struct vec3 on_drum = quat_rotate(quat_conjugate(rotation), out);
        const double angle = atan2(on_drum.x, -on_drum.z);
        for (int k = 0; k < 3; k++)
            view.rgb[3 * i + k] =
                (uint8_t)lround(255 * sqrt(fmin(1, albedo_at(angle, down, k) * light_at(out, strength))));
    }
    find_edge_distances();
    view.frame = (struct depth_frame){.width = WIDTH,
                                      .height = HEIGHT,
                                      .fx = lens.fx,
                                      .depth = view.depth,
                                      .part = view.part,
                                      .edge_distance = view.edge_distance,
                                      .half_width = view.half_width,
                                      .max_edge_distance = DEPTH_FRAME_MAX_EDGE_PX,
                                      .has_mask = true,
                                      .right = WIDTH - 1,
                                      .bottom = HEIGHT - 1};
}

static struct vertex_color_builder *open_builder(int threads)
{
    const struct vertex_color_target target = {&drum.bind_pose, &drum.surface, drum.skins};
    struct vertex_color_builder *builder;
    EXPECT_STATUS(vertex_color_open(&builder, &target, &drum.calibration, threads), OK);
    return builder;
}

static void add_view(struct vertex_color_builder *builder, double time_s)
{
    const struct vertex_color_frame frame = {.depth_frame = &view.frame,
                                             .rgb = view.rgb,
                                             .transforms = &view.transforms,
                                             .deformation = drum.deformation,
                                             .world_from_camera = POSE_IDENTITY,
                                             .time_s = time_s};
    vertex_color_add(builder, &frame);
}

// A turn of the drum under that light; now and then the lights are out, if `dark`.
static void add_turn(struct vertex_color_builder *builder, double strength, bool dark)
{
    for (int i = 0; i < FRAMES; i++) {
        film(2 * PI * i / FRAMES, strength);
        for (int k = 0; dark && i % 6 == 5 && k < 3 * PIXELS; k++)
            view.rgb[k] = (uint8_t)(view.rgb[k] / 3);
        add_view(builder, 0.04 * i);
    }
}

static struct vertex_colors solve(struct vertex_color_builder *builder)
{
    struct vertex_colors colors;
    EXPECT_STATUS(vertex_color_solve(builder, &colors), OK);
    return colors;
}

// Albedo against the truth, gamma-encoded, without the factor that is common to all: mean and largest difference.
static double albedo_error(const struct vertex_colors *colors, double *most)
{
    double estimated = 0, truth = 0, sum = 0;
    int count = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < POINTS; i++)
            for (int k = 0; k < 3 && !colors->filled[i]; k++) {
                const double wanted = albedo_at(2 * PI * (i % AROUND) / AROUND, drum.point[i].y, k);
                const double found = (double)colors->color[i][k];
                if (!pass) {
                    estimated += found;
                    truth += wanted;
                    continue;
                }
                const double off = fabs(sqrt(found * truth / estimated) - sqrt(wanted));
                *most = fmax(*most, off);
                sum += off;
                count++;
            }
    return sum / count;
}

static int count_filled(const struct vertex_colors *colors)
{
    int filled = 0;
    for (int i = 0; i < POINTS; i++)
        filled += colors->filled[i];
    return filled;
}

// ------------------------------------------------------------- albedo and light

static void test_even_light(void **state)
{
    (void)state;
    struct vertex_color_builder *builder = open_builder(2);
    double most = 0;
    add_turn(builder, 0, false);
    struct vertex_colors colors = solve(builder);
    const double mean = albedo_error(&colors, &most);
    print_message("even light: %.4f off, at most %.4f; irradiance %.4f to the right\n", mean, most,
                  (double)colors.irradiance.term[1]);
    EXPECT_AT_MOST(mean, 0.001);                              // measured 0.0003
    EXPECT_AT_MOST(most, 0.005);                              // measured 0.0017
    EXPECT_NEAR((double)colors.irradiance.term[1], 0, 0.001); // measured 0.0001
    EXPECT_AT_MOST(count_filled(&colors), POINTS / 6);        // the rims, at the edges of the image of the drum
    vertex_colors_free(&colors);
    vertex_color_close(&builder);
}

// A point is lit in some frames and in the shade in others: its albedo is one.
static void test_light_from_one_side(void **state)
{
    (void)state;
    const double strength = 0.4;
    struct vertex_color_builder *builder = open_builder(2);
    double most = 0, ratio_off = 0;
    add_turn(builder, strength, false);
    struct vertex_colors colors = solve(builder);
    const double mean = albedo_error(&colors, &most);
    const float ahead[3] = {0, 0, -1};
    for (int i = -4; i <= 4; i++) { // of the light that falls on what the camera sees
        const double angle = i * 0.25;
        const float normal[3] = {(float)sin(angle), 0, (float)-cos(angle)};
        const double found =
            (double)(sh_irradiance_at(&colors.irradiance, normal) / sh_irradiance_at(&colors.irradiance, ahead));
        const double wanted = light_at(v3(sin(angle), 0, -cos(angle)), strength) / light_at(v3(0, 0, -1), strength);
        ratio_off = fmax(ratio_off, fabs(found - wanted));
    }
    print_message("light from one side: %.4f off, at most %.4f; irradiance %.3f off\n", mean, most, ratio_off);
    EXPECT_AT_MOST(mean, 0.001);     // measured 0.0003
    EXPECT_AT_MOST(most, 0.005);     // measured 0.0010
    EXPECT_AT_MOST(ratio_off, 0.08); // measured 0.044: the ridge on the terms
    vertex_colors_free(&colors);
    vertex_color_close(&builder);
}

// Every sixth frame is far too dark: the others decide.
static void test_dark_frames_are_outliers(void **state)
{
    (void)state;
    struct vertex_color_builder *builder = open_builder(2);
    double most = 0;
    add_turn(builder, 0, true);
    struct vertex_colors colors = solve(builder);
    const double mean = albedo_error(&colors, &most);
    print_message("dark frames: %.4f off, at most %.4f\n", mean, most);
    EXPECT_AT_MOST(mean, 0.001); // measured 0.0003
    vertex_colors_free(&colors);
    vertex_color_close(&builder);
}

// ------------------------------------------------------------- what is seen

// One frame: the half that faces the camera has its colours, the back none of its own, and times are the frame's.
static void test_one_frame(void **state)
{
    (void)state;
    struct vertex_color_builder *builder = open_builder(1);
    double most = 0;
    film(0, 0);
    add_view(builder, 2.5);
    struct vertex_colors colors = solve(builder);
    EXPECT_AT_MOST(albedo_error(&colors, &most), 0.01);
    int behind = 0, before = 0;
    for (int i = 0; i < POINTS; i++) {
        const double facing = cos(2 * PI * (i % AROUND) / AROUND);
        before += facing > 0.5 && !colors.filled[i];
        behind += facing < 0.2 && !colors.filled[i];
        EXPECT_TRUE(isfinite(colors.color[i][0]) && colors.color[i][0] >= 0);
        if (!colors.filled[i])
            EXPECT_NEAR((double)colors.time_s[i], 2.5, 1e-6);
    }
    EXPECT_INT(behind, 0);
    EXPECT_AT_LEAST(before, POINTS / 4);
    vertex_colors_free(&colors);
    vertex_color_close(&builder);
}

// Something stands between: its depth is not the drum's, and nothing of the image is taken.
static void test_hidden_behind_something(void **state)
{
    (void)state;
    struct vertex_color_builder *builder = open_builder(1);
    film(0, 0);
    for (int i = 0; i < PIXELS; i++)
        view.depth[i] = 500;
    add_view(builder, 0);
    struct vertex_colors colors = solve(builder);
    EXPECT_INT(count_filled(&colors), POINTS);
    vertex_colors_free(&colors);
    vertex_color_close(&builder);
}

static void test_no_frames(void **state)
{
    (void)state;
    struct vertex_color_builder *builder = open_builder(2);
    struct vertex_colors colors = solve(builder);
    EXPECT_INT(count_filled(&colors), POINTS);
    for (int i = 0; i < POINTS; i++)
        EXPECT_NEAR((double)colors.color[i][0], 0, 0);
    EXPECT_NEAR((double)colors.irradiance.term[0], 1, 0); // even
    for (int k = 1; k < SH_TERMS; k++)
        EXPECT_NEAR((double)colors.irradiance.term[k], 0, 0);
    vertex_colors_free(&colors);
    vertex_colors_free(&colors);
    vertex_color_close(&builder);
    vertex_color_close(&builder);
}

// A black image has no light to tell from its albedo.
static void test_black_image(void **state)
{
    (void)state;
    struct vertex_color_builder *builder = open_builder(1);
    film(0, 0);
    memset(view.rgb, 0, sizeof view.rgb);
    add_view(builder, 0);
    struct vertex_colors colors = solve(builder);
    for (int i = 0; i < POINTS; i++)
        EXPECT_NEAR((double)colors.color[i][1], 0, 0);
    for (int k = 0; k < SH_TERMS; k++)
        EXPECT_TRUE(isfinite(colors.irradiance.term[k]));
    vertex_colors_free(&colors);
    vertex_color_close(&builder);
}

static void test_any_number_of_threads(void **state)
{
    (void)state;
    struct vertex_colors colors[2];
    for (int i = 0; i < 2; i++) {
        struct vertex_color_builder *builder = open_builder(i ? 7 : 1);
        for (int k = 0; k < 4; k++) {
            film(0.5 * k, 0.3);
            add_view(builder, k);
        }
        colors[i] = solve(builder);
        vertex_color_close(&builder);
    }
    EXPECT_TRUE(!memcmp(colors[0].color, colors[1].color, sizeof *colors[0].color * POINTS));
    EXPECT_TRUE(!memcmp(colors[0].irradiance.term, colors[1].irradiance.term, sizeof colors[0].irradiance.term));
    for (int i = 0; i < 2; i++)
        vertex_colors_free(&colors[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_even_light),
        cmocka_unit_test(test_light_from_one_side),
        cmocka_unit_test(test_dark_frames_are_outliers),
        cmocka_unit_test(test_one_frame),
        cmocka_unit_test(test_hidden_behind_something),
        cmocka_unit_test(test_no_frames),
        cmocka_unit_test(test_black_image),
        cmocka_unit_test(test_any_number_of_threads),
    };
    return cmocka_run_group_tests(tests, make_drum, free_drum);
}
