// An image is the same whether what its camera sees of the room was kept from the image before or not.
#include "tests/support/test.h"

#include "tests/world/world.h"

#include <pthread.h>
#include <string.h>

enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT, TIMES = 3 };

static const double times_s[TIMES] = {0.4, 1.7, 3.1};

struct picture {
    uint8_t color[3 * PIXELS], mask[PIXELS];
    uint16_t depth[PIXELS];
};

static struct world *open_world(void)
{
    struct world_options o = world_default_options();
    struct world *w;
    o.motion = "kata";
    o.plain = true;
    o.threads = 2;
    o.box[o.boxes++] = (struct world_box){{0.7, -0.9, 0}, {1.2, -0.4, 0.8}}; // shadow falls on it
    EXPECT_STATUS(world_open(&w, &o), OK);
    return w;
}

static struct lens small_lens(void) { return world_viewer_calibration(WIDTH / 640.0).color; }

// The i-th camera's picture: 0 the sensor, others further to the right.
static bool shoot(const struct world *w, int camera, double time_s, bool actor, struct picture *p)
{
    struct world_shot shot = {small_lens(), world_sensor_pose(w), time_s, actor};
    shot.world_from_camera.translation.x += 0.2 * camera;
    return world_render(w, &shot, &(struct world_image){p->color, p->depth, p->mask}) == OK;
}

// As a world that has never seen the camera renders it.
static void shoot_afresh(int camera, double time_s, bool actor, struct picture *p)
{
    struct world *w = open_world();
    EXPECT_TRUE(shoot(w, camera, time_s, actor, p));
    world_close(&w);
}

static void expect_same(const struct picture *p, const struct picture *truth)
{
    int color = 0, depth = 0, mask = 0;
    for (int i = 0; i < 3 * PIXELS; i++)
        color += p->color[i] != truth->color[i];
    for (int i = 0; i < PIXELS; i++) {
        depth += p->depth[i] != truth->depth[i];
        mask += p->mask[i] != truth->mask[i];
    }
    EXPECT_INT(color, 0);
    EXPECT_INT(depth, 0);
    EXPECT_INT(mask, 0);
}

static void test_kept_or_not_the_image_is_the_same(void **state)
{
    (void)state;
    static struct picture truth[TIMES], empty, p;
    EXPECT_INT(small_lens().width, WIDTH);
    EXPECT_INT(small_lens().height, HEIGHT);
    for (int i = 0; i < TIMES; i++)
        shoot_afresh(0, times_s[i], true, &truth[i]);
    shoot_afresh(0, 0, false, &empty);
    EXPECT_TRUE(memcmp(&truth[0], &truth[1], sizeof p) && memcmp(&truth[0], &empty, sizeof p));
    struct world *w = open_world();
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i < TIMES; i++) {
            EXPECT_TRUE(shoot(w, 0, times_s[i], true, &p));
            expect_same(&p, &truth[i]);
        }
        EXPECT_TRUE(shoot(w, 0, 0, false, &p));
        expect_same(&p, &empty);
        for (int k = 1; k < 4; k++) // others film in turn with it, and the last time stand still themselves
            EXPECT_TRUE(shoot(w, round < 2 ? 3 * round + k : k, 1, true, &p));
    }
    // Depth alone, where there is a view and where there is none.
    static uint16_t depth[PIXELS];
    for (int camera = 0; camera < 2; camera++) {
        struct world_shot shot = {small_lens(), world_sensor_pose(w), times_s[1], true};
        shot.world_from_camera.translation.x += 0.2 * camera;
        EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.depth = depth}), OK);
        shoot_afresh(camera, times_s[1], true, &p);
        EXPECT_TRUE(!memcmp(depth, p.depth, sizeof depth));
    }
    world_close(&w);
}

struct film {
    const struct world *world;
    int number;
    const struct picture *truth; // of cameras 0 and 1
    int wrong;
};

// Both threads film with both cameras, one more often with one and the other with the other.
static void *film(void *context)
{
    struct film *f = context;
    struct picture *p = malloc(sizeof *p);
    for (int i = 0; i < 12 && p; i++) {
        const int camera = i % 3 ? f->number : 1 - f->number;
        f->wrong += !shoot(f->world, camera, times_s[0], true, p) || memcmp(p, &f->truth[camera], sizeof *p) != 0;
    }
    f->wrong += !p;
    free(p);
    return NULL;
}

static void test_two_threads_film_with_two_cameras(void **state)
{
    (void)state;
    static struct picture truth[2];
    struct world *w = open_world();
    pthread_t thread[2];
    struct film films[2];
    for (int i = 0; i < 2; i++) {
        shoot_afresh(i, times_s[0], true, &truth[i]);
        films[i] = (struct film){w, i, truth, 0};
    }
    for (int i = 0; i < 2; i++)
        EXPECT_TRUE(!pthread_create(&thread[i], NULL, film, &films[i]));
    for (int i = 0; i < 2; i++)
        pthread_join(thread[i], NULL);
    EXPECT_INT(films[0].wrong, 0);
    EXPECT_INT(films[1].wrong, 0);
    world_close(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kept_or_not_the_image_is_the_same),
        cmocka_unit_test(test_two_threads_film_with_two_cameras),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
