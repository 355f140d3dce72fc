// The cards of takes: what they show and say of takes that are damaged, or cannot be watched.
#include "app/ui/take_list.h"
#include "base/clock.h"
#include "capture/take_verdict.h"
#include "reenact/render/actor_renderer.h"
#include "tests/support/glass.h"
#include "tests/support/recording_sample.h"
#include "tests/support/sql.h"

static struct gpu *gpu;

static void load(struct take_list *list, struct recording *r)
{
    enum status status = take_list_open(list, r, "film.reenact");
    while (status == OK)
        status = take_list_load(list, gpu, r, 0, list->count);
    EXPECT_STATUS(status, NOTHING);
}

// Of a sensor without colour: its takes are drawn from their depth where they are looked at.
static void test_take_without_color(void **state)
{
    (void)state;
    static struct sample_frame m;
    struct calibration calibration = sample_calibration();
    calibration.color = (struct lens){0};
    calibration.color_from_depth = POSE_IDENTITY;
    calibration.registered = true;
    struct recording_writer *w;
    struct recording *r;
    struct take *take;
    struct take_list list;
    struct renderer *renderer;
    const char *path = sample_path("no-color");
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "depth", &calibration), OK);
    for (int i = 0; i < 5; i++) {
        sample_frame_make(&m, 7 * i);
        m.frame.jpeg = NULL;
        m.frame.depth = m.depth;
        m.frame.has_skeleton = true;
        EXPECT_STATUS(recording_add_frame(w, &m.frame), OK);
        free(m.jpeg);
    }
    EXPECT_STATUS(recording_put_body(w, &(struct body){.representative_frame = 3, .radius_rate = {0.3}}), OK);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_begin_take(w, "nobody", &calibration), OK);
    sample_frame_make(&m, 7);
    free(m.jpeg);
    m.frame.jpeg = NULL;
    m.frame.has_skeleton = false;
    EXPECT_STATUS(recording_add_frame(w, &m.frame), OK);
    EXPECT_STATUS(recording_close(&w), OK);

    EXPECT_STATUS(recording_open(&r, path), OK);
    load(&list, r);
    EXPECT_TRUE(!list.cards[0].trouble && list.cards[0].image);
    assert_string_equal(list.cards[1].trouble, "no person in it");
    EXPECT_STATUS(take_open(&take, r, "depth"), OK);
    const struct renderer_options options = renderer_default_options();
    EXPECT_STATUS(renderer_open(&renderer, gpu, take, &calibration.depth, &options), ERR_INPUT);
    EXPECT_SAYS("the take has no colour");
    take_close(&take);
    EXPECT_STATUS(take_open_drawn(&take, r, "depth"), OK);
    EXPECT_STATUS(renderer_open(&renderer, gpu, take, &calibration.depth, &options), OK);
    renderer_close(&renderer);
    take_close(&take);
    take_list_close(&list);
    recording_free(&r);
}

// A card shows another image where the one that it would show is damaged.
static void test_damaged_image_is_passed_over(void **state)
{
    (void)state;
    const char *path = sample_path("damaged");
    struct recording *r;
    struct take_list list;
    sample_recording_write(path);
    enum { WANTED = FRAMES * 2 / 5 };
    char sql[160];
    snprintf(sql, sizeof sql,
             "UPDATE picture SET color = zeroblob(100) WHERE id BETWEEN (1 << 32) + %d AND (1 << 32) + %d", WANTED - 1,
             WANTED + 1);
    run_sql(path, sql);
    EXPECT_STATUS(recording_open(&r, path), OK);
    load(&list, r);
    EXPECT_INT(list.count, 2);
    EXPECT_TRUE(list.cards[0].image && !list.cards[0].trouble && list.cards[0].complete);
    EXPECT_TRUE(!list.cards[1].complete);
    take_list_close(&list);
    recording_free(&r);
}

// Of a large camera: a card's image takes no more of the GPU's memory than it shows.
static void test_large_images_are_shrunk(void **state)
{
    (void)state;
    enum { W = 1920, H = 1080, SHOWN = 640 };
    static uint8_t rgb[W * H * 3];
    static struct sample_frame m;
    struct calibration calibration = sample_calibration();
    calibration.color = (struct lens){.width = W, .height = H, .fx = 1000, .fy = 1000, .cx = 959.5, .cy = 539.5};
    const char *path = sample_path("large");
    struct recording_writer *w;
    struct recording *r;
    struct take_list list;
    sample_frame_make(&m, 7);
    free(m.jpeg);
    EXPECT_STATUS(jpeg_encode(rgb, W, H, 80, &m.jpeg, &m.frame.jpeg_bytes), OK);
    m.frame.jpeg = m.jpeg;
    m.frame.has_skeleton = true;
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "large", &calibration), OK);
    EXPECT_STATUS(recording_add_frame(w, &m.frame), OK);
    EXPECT_STATUS(recording_put_body(w, &(struct body){.representative_frame = 0}), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    free(m.jpeg);
    EXPECT_STATUS(recording_open(&r, path), OK);
    const size_t before = gpu_get_counts(gpu).bytes_held;
    load(&list, r);
    EXPECT_TRUE(list.cards[0].image);
    EXPECT_NEAR(list.cards[0].image_aspect, 16 / 9.0, 1e-9);
    EXPECT_NEAR(gpu_get_counts(gpu).bytes_held - before, SHOWN * (SHOWN * 9 / 16) * 4, 0);
    take_list_close(&list);
    recording_free(&r);
}

static void write_takes(const char *path, int count)
{
    static struct sample_frame m;
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, path), OK);
    for (int i = 0; i < count; i++) {
        char name[16];
        snprintf(name, sizeof name, "take %d", i);
        sample_frame_make(&m, 7);
        m.frame.jpeg = m.jpeg;
        m.frame.has_skeleton = true;
        EXPECT_STATUS(recording_begin_take(w, name, &calibration), OK);
        EXPECT_STATUS(recording_add_frame(w, &m.frame), OK);
        EXPECT_STATUS(recording_end_take(w), OK);
        free(m.jpeg);
    }
    EXPECT_STATUS(recording_close(&w), OK);
}

// Those in sight come first, and what is far from them gives its image up.
static void test_a_long_list_holds_few_images(void **state)
{
    (void)state;
    enum { COUNT = 4 * TAKE_LIST_AHEAD, FROM = COUNT - 12 };
    const char *path = sample_path("long");
    struct recording *r;
    struct take_list list;
    write_takes(path, COUNT);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_list_open(&list, r, "film.reenact"), OK);
    const size_t before = gpu_get_counts(gpu).bytes_held;
    while (take_list_load(&list, gpu, r, 0, 8) == OK)
        ;
    const size_t one = (gpu_get_counts(gpu).bytes_held - before) / (8 + TAKE_LIST_AHEAD);
    EXPECT_AT_LEAST((double)one, WIDTH * HEIGHT * 3);
    EXPECT_TRUE(list.cards[7].image && list.cards[7 + TAKE_LIST_AHEAD].image);
    EXPECT_TRUE(!list.cards[8 + TAKE_LIST_AHEAD].image && !list.cards[8 + TAKE_LIST_AHEAD].loaded);
    for (int i = 0; i < 4; i++)
        EXPECT_STATUS(take_list_load(&list, gpu, r, FROM, FROM + 4), OK);
    for (int i = 0; i < 4; i++)
        EXPECT_TRUE(list.cards[FROM + i].image && list.cards[FROM + i].loaded);
    EXPECT_TRUE(!list.cards[0].image && !list.cards[FROM - 1].image && !list.cards[FROM + 4].image);
    while (take_list_load(&list, gpu, r, FROM, FROM + 4) == OK)
        ;
    EXPECT_NEAR(gpu_get_counts(gpu).bytes_held - before, (double)((COUNT - FROM + TAKE_LIST_AHEAD) * one), 0);
    take_list_close(&list);
    EXPECT_INT(gpu_get_counts(gpu).bytes_held, before);
    recording_free(&r);
}

// Of a file that keeps no verdict the takes are judged beside the screen; the file stays as it is.
static void test_takes_without_a_verdict_are_judged(void **state)
{
    (void)state;
    static char path[200];
    char text[VERDICT_TEXT_BYTES];
    struct glass g;
    struct recording *r;
    struct take_verdict verdict;
    uint8_t *before, *after;
    size_t before_count, after_count;
    snprintf(path, sizeof path, "%s", sample_path("unjudged"));
    sample_recording_write(path);
    EXPECT_STATUS(file_read(path, &before, &before_count), OK);
    const struct viewer_options options = {.file = path, .refresh_hz = 60};
    glass_open(&g, 640, 400, &options);
    const struct take_card *card = &viewer_takes(g.viewer)->cards[0];
    const int64_t until_ns = clock_now_ns() + 60 * (int64_t)1000000000;
    glass_draw(&g);
    while (!card->judged && clock_now_ns() < until_ns) {
        clock_sleep_until_ns(clock_now_ns() + 5000000);
        glass_draw(&g);
    }
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_verdict_get(r, card->name, NULL, &verdict), OK);
    recording_free(&r);
    printf("'%s' of '%s'\n", card->verdict, verdict_text(&verdict, text));
    EXPECT_TRUE(*card->verdict && !strncmp(card->verdict, text, strlen(card->verdict)));
    EXPECT_TRUE(card->good == verdict_is_good(&verdict));
    glass_close(&g);
    EXPECT_STATUS(file_read(path, &after, &after_count), OK);
    EXPECT_INT(after_count, before_count);
    EXPECT_TRUE(!memcmp(before, after, before_count));
    free(before);
    free(after);
}

static bool in_sight(const struct glass *g, int take)
{
    return take >= viewer_screens(g->viewer)->first_in_sight && take < viewer_screens(g->viewer)->end_in_sight;
}

// The take that keys select is always in sight; the wheel scrolls, and does not bring it back.
static void test_the_page_follows_what_is_selected(void **state)
{
    (void)state;
    enum { COUNT = 60 };
    static char path[200];
    struct glass g;
    snprintf(path, sizeof path, "%s", sample_path("page"));
    write_takes(path, COUNT);
    const struct viewer_options options = {.file = path, .refresh_hz = 60};
    glass_open(&g, 640, 400, &options);
    struct view_state *s = g.state;
    glass_draw(&g);
    EXPECT_INT(s->page, PAGE_TAKES);
    EXPECT_TRUE(in_sight(&g, 0) && !in_sight(&g, COUNT - 1));
    for (int i = 0; i < COUNT - 1; i++) {
        glass_press(&g, WINDOW_KEY_RIGHT);
        EXPECT_INT(s->take, i + 1);
        EXPECT_TRUE(in_sight(&g, s->take));
    }
    EXPECT_TRUE(!in_sight(&g, 0));
    glass_turn_wheel(&g, 1000);
    EXPECT_TRUE(in_sight(&g, 0) && s->take == COUNT - 1);
    glass_draw(&g);
    EXPECT_NEAR(viewer_screens(g.viewer)->scroll, 0, 0);
    glass_turn_wheel(&g, -3);
    EXPECT_NEAR(viewer_screens(g.viewer)->scroll, 300, 0);
    glass_press(&g, WINDOW_KEY_HOME);
    EXPECT_TRUE(in_sight(&g, 0) && s->take == 0);
    glass_close(&g);
}

static int set_up(void **state) { return sample_folder_make(state) || gpu_open(&gpu) != OK; }

static int tear_down(void **state)
{
    gpu_close(&gpu);
    return sample_folder_remove(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_take_without_color),
        cmocka_unit_test(test_damaged_image_is_passed_over),
        cmocka_unit_test(test_large_images_are_shrunk),
        cmocka_unit_test(test_a_long_list_holds_few_images),
        cmocka_unit_test(test_takes_without_a_verdict_are_judged),
        cmocka_unit_test(test_the_page_follows_what_is_selected),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
