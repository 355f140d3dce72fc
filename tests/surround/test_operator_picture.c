// The operator's picture by the graphics card against the session's own: surroundings, body, lines, text; and the
// window's format.
#include "tests/support/test.h"

#include "platform/screen/gpu_draw2d.h"
#include "reenact/render/shaders.h"
#include "surround/gpu/operator_picture.h"

#include <stdlib.h>

enum { WIDTH = 320, HEIGHT = 240 };

struct stage {
    struct drive_session session;
    struct gpu *gpu;
    struct operator_picture *picture;
    struct gpu_draw2d *draw;
};

static void open_stage(struct stage *s)
{
    struct drive_options options = drive_default_options();
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    options.width = WIDTH;
    options.height = HEIGHT;
    EXPECT_STATUS(drive_session_open(&s->session, "sim:2", &options), OK);
    EXPECT_STATUS(gpu_open(&s->gpu), OK);
    EXPECT_STATUS(operator_picture_open(&s->picture, s->gpu), OK);
    EXPECT_STATUS(gpu_draw2d_open(&s->draw, s->gpu, &shaders), OK);
}

static void close_stage(struct stage *s)
{
    gpu_draw2d_close(&s->draw);
    operator_picture_close(&s->picture);
    gpu_close(&s->gpu);
    drive_session_close(&s->session);
}

// As a window shows it, over black. rgba[4 * width * height].
static void show(struct stage *s, int width, int height, uint8_t *rgba)
{
    const struct gpu_texture *texture;
    struct gpu_target *target;
    const float black[3] = {0, 0, 0}, w = (float)width, h = (float)height;
    EXPECT_STATUS(operator_picture_draw(s->picture, &s->session, width, height, &texture), OK);
    EXPECT_STATUS(gpu_target_open(&target, s->gpu, width, height), OK);
    const struct gpu_draw2d_vertex corners[4] = {{0, 0, 0, 0, {255, 255, 255, 255}},
                                                 {w, 0, 1, 0, {255, 255, 255, 255}},
                                                 {w, h, 1, 1, {255, 255, 255, 255}},
                                                 {0, h, 0, 1, {255, 255, 255, 255}}};
    const uint16_t indices[6] = {0, 1, 2, 0, 2, 3};
    const struct gpu_draw2d_batch batch = {texture, 0, 0, w, h, 0, 0, 6};
    const struct gpu_draw2d_list list = {corners, indices, &batch, 4, 6, 1};
    const struct gpu_draw2d_view to = {target, width, height, 0, black};
    gpu_draw2d_begin(s->draw, &to);
    gpu_draw2d_draw(s->draw, &list);
    EXPECT_STATUS(gpu_draw2d_end(s->draw), OK);
    EXPECT_STATUS(gpu_target_read(target, rgba), OK);
    gpu_target_close(&target);
}

static void drive(struct stage *s, double seconds)
{
    const struct drive_command ahead = {0.2, 0.05};
    for (int i = 0; i < (int)(seconds * 20); i++)
        EXPECT_STATUS(drive_session_step(&s->session, s->session.now_ns + 50000000, &ahead), OK);
}

static double psnr(const uint8_t *rgb, const uint8_t *rgba)
{
    double sum = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        for (int c = 0; c < 3; c++)
            sum += (rgb[3 * i + c] - rgba[4 * i + c]) * (rgb[3 * i + c] - rgba[4 * i + c]);
    return 10 * log10(255 * 255 / (sum / (3 * WIDTH * HEIGHT)));
}

// Of the line to what is nearest, which is drawn at 85 %.
static int is_line(const struct stage *s, const uint8_t *p)
{
    const uint8_t *color = overlay_warning_color(overlay_warning_of(s->session.nearest_m));
    return abs(p[0] - color[0]) < 40 && abs(p[1] - color[1]) < 40 && abs(p[2] - color[2]) < 40;
}

static void test_as_the_session_draws_it(void **state)
{
    (void)state;
    static struct stage s;
    static uint8_t rgba[4 * WIDTH * HEIGHT];
    const struct surround_view *view;
    int all = 0, all_card = 0;
    open_stage(&s);
    drive(&s, 3);
    for (int k = 0; k < 3; k++) {
        s.session.eye.viewpoint = (enum viewpoint)k;
        EXPECT_STATUS(drive_session_draw(&s.session, &view), OK);
        for (int i = 0; i < 8; i++) // the pictures come one in each image, the line to what is nearest an image later
            show(&s, WIDTH, HEIGHT, rgba);
        int line = 0, card = 0;
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            line += is_line(&s, view->rgb + 3 * i);
            card += is_line(&s, rgba + 4 * i);
        }
        const double same = psnr(view->rgb, rgba);
        print_message("viewpoint %d: %.1f dB; line pixels %d and %d\n", k, same, line, card);
        EXPECT_AT_LEAST(same, 24);
        // All heights of a wall are equally near: to which the line goes is up to rounding, and so is its length.
        EXPECT_AT_LEAST(card, 1);
        all += line;
        all_card += card;
    }
    EXPECT_AT_LEAST(all_card, 0.5 * all);
    close_stage(&s);
}

// As wide an angle as the session's in the middle of it.
static void test_a_wide_window(void **state)
{
    (void)state;
    static struct stage s;
    static uint8_t rgba[4 * 2 * WIDTH * HEIGHT], middle[4 * WIDTH * HEIGHT];
    const struct surround_view *view;
    open_stage(&s);
    drive(&s, 1);
    s.session.eye.viewpoint = VIEWPOINT_ABOVE;
    EXPECT_STATUS(drive_session_draw(&s.session, &view), OK);
    for (int i = 0; i < 8; i++)
        show(&s, 2 * WIDTH, HEIGHT, rgba);
    for (int y = 0; y < HEIGHT; y++)
        memcpy(middle + 4 * WIDTH * y, rgba + 4 * (2 * WIDTH * y + WIDTH / 2), 4 * WIDTH);
    EXPECT_AT_LEAST(psnr(view->rgb, middle), 20); // the text stands elsewhere
    close_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_as_the_session_draws_it),
        cmocka_unit_test(test_a_wide_window),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
