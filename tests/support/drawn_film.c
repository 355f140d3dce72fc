#include "tests/support/test.h"

#include "tests/support/drawn_film.h"

#include "reenact/render/actor_renderer.h"

enum { VIEWS = 12 };
static const double VIEW_SCALE = 0.25;

// The view number i of the person at time_s, a twelfth of a turn after the one before.
static struct pose view_pose(const struct world *world, double time_s, int i)
{
    const struct skeleton joints = world_joints(world, time_s);
    const double angle = 6.283185307179586 * i / VIEWS;
    const struct vec3 at = joints.joint[JOINT_WAIST], from = v3(at.x + 2.6 * sin(angle), at.y - 2.6 * cos(angle), 1.3),
                      z = v3_unit(v3_sub(v3(at.x, at.y, fmin(at.z, 0.9)), from)), x = v3_unit(v3_cross(z, v3(0, 0, 1))),
                      y = v3_cross(z, x);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return (struct pose){quat_from_matrix(m), from};
}

struct canvas {
    struct lens lens;
    uint8_t *room, *expected, *mask, *drawn, *actor;
};

static void score_view(const struct canvas *c, struct drawn_score *score)
{
    double both = 0, either = 0, squares = 0;
    for (int i = 0; i < c->lens.width * c->lens.height; i++) {
        const bool there = c->mask[i] != 0, shown = c->actor[4 * i + 3] >= 128;
        both += there && shown;
        either += there || shown;
        for (int k = 0; k < 3 && (there || shown); k++) {
            const double d = (double)c->drawn[3 * i + k] - (double)c->expected[3 * i + k];
            squares += d * d;
        }
    }
    if (either > 0) {
        score->outline += both / either / VIEWS;
        score->psnr_db += 10 * log10(65025 / fmax(squares / (3 * either), 1e-6)) / VIEWS;
    }
}

static void draw_view(const struct world *world, struct renderer *renderer, struct world_shot *shot,
                      const struct canvas *c)
{
    // A take without a place stands in a world with z up for a camera held level, which has the sensor at its origin.
    static const struct pose level_from_sensor = {{-0.7071067811865476, 0, 0, 0.7071067811865476}, {0, 0, 0}};
    const struct pose take_from_world = pose_multiply(level_from_sensor, pose_inverse(world_sensor_pose(world)));
    struct renderer_result result;
    shot->actor = false;
    EXPECT_STATUS(world_render(world, shot, &(struct world_image){.color = c->room}), OK);
    shot->actor = true;
    EXPECT_STATUS(world_render(world, shot, &(struct world_image){.color = c->expected, .mask = c->mask}), OK);
    const struct renderer_view view = {.world_from_camera = pose_multiply(take_from_world, shot->world_from_camera),
                                       .time_ns = (int64_t)(shot->time_s * 1e9 + 0.5),
                                       .color = c->room};
    EXPECT_STATUS(renderer_draw(renderer, &view, &result), OK);
    EXPECT_STATUS(renderer_read(renderer, c->drawn), OK);
    EXPECT_STATUS(renderer_read_actor(renderer, c->actor), OK);
}

struct drawn_score draw_film(const struct world *world, const char *path, const struct drawn_film *film,
                             struct gpu *gpu)
{
    struct recording *recording;
    struct take *take;
    struct renderer *renderer;
    struct drawn_score score = {0};
    struct canvas c = {.lens = world_calibration(VIEW_SCALE).color};
    const size_t pixels = (size_t)c.lens.width * (size_t)c.lens.height;
    const struct renderer_options options = renderer_default_options();
    c.room = malloc(14 * pixels);
    assert_non_null(c.room);
    c.expected = c.room + 3 * pixels;
    c.drawn = c.expected + 3 * pixels;
    c.actor = c.drawn + 3 * pixels;
    c.mask = c.actor + 4 * pixels;
    EXPECT_STATUS(recording_open(&recording, path), OK);
    EXPECT_STATUS(take_open(&take, recording, film->take), OK);
    EXPECT_STATUS(renderer_open(&renderer, gpu, take, &c.lens, &options), OK);
    for (int i = 0; i < VIEWS; i++) {
        // Frames of the film itself, a twelfth of it apart, each from another side.
        const double time_s = floor(film->seconds * film->rate_hz * ((i * 5) % VIEWS + 0.5) / VIEWS) / film->rate_hz;
        struct world_shot shot = {c.lens, view_pose(world, time_s, i), time_s, false};
        draw_view(world, renderer, &shot, &c);
        score_view(&c, &score);
    }
    renderer_close(&renderer);
    take_close(&take);
    recording_free(&recording);
    free(c.room);
    return score;
}
