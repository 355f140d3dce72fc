// Every shader compiles and links with this machine's driver, without a window; a broken
// one is refused with the driver's message.
#include "tests/support/test.h"

#include "platform/screen/gpu.h"
#include "reenact/render/shaders.h"

#include <stdio.h>
#include <string.h>

static bool ends(const char *name, const char *ending)
{
    size_t n = strlen(name), e = strlen(ending);
    return n >= e && !strcmp(name + n - e, ending);
}

// The vertex shader of a fragment shader: of the same name, or of the name before one of its '_', or fullscreen.vert.
static const char *vertex_of(const char *name)
{
    for (const char *end = strrchr(name, '.'); end > name; end--)
        for (int i = 0; i < shader_text_count; i++)
            if ((*end == '.' || *end == '_') && !strncmp(shader_texts[i].name, name, (size_t)(end - name)) &&
                !strcmp(shader_texts[i].name + (end - name), ".vert"))
                return shader_texts[i].text;
    return shader_find("fullscreen.vert");
}

static void test_every_shader_compiles(void **state)
{
    (void)state;
    struct gpu *g;
    EXPECT_STATUS(gpu_open(&g), OK);
    int vertex = 0, fragment = 0;
    for (int i = 0; i < shader_text_count; i++) {
        vertex += ends(shader_texts[i].name, ".vert");
        if (!ends(shader_texts[i].name, ".frag"))
            continue;
        fragment++;
        struct gpu_program_source pair = {
            .name = shader_texts[i].name, .vertex = vertex_of(shader_texts[i].name), .fragment = shader_texts[i].text};
        struct gpu_program *p;
        EXPECT_STATUS(gpu_program_open(&p, g, &pair), OK);
        gpu_program_close(&p);
    }
    EXPECT_AT_LEAST(vertex, 2);
    EXPECT_AT_LEAST(fragment, 2);
    EXPECT_INT(vertex + fragment, shader_text_count);
    gpu_close(&g);
    EXPECT_TRUE(g == NULL);
}

static void test_broken_shaders_are_refused(void **state)
{
    (void)state;
    struct gpu *g;
    EXPECT_STATUS(gpu_open(&g), OK);
    struct gpu_program *p;
    struct gpu_program_source text = {.name = "broken",
                                      .vertex = shader_find("fullscreen.vert"),
                                      .fragment = "#version 300 es\nvoid main() { nonsense = 1; }\n"};
    EXPECT_STATUS(gpu_program_open(&p, g, &text), ERR_DEVICE);
    EXPECT_TRUE(p == NULL);
    EXPECT_SAYS("broken");
    EXPECT_SAYS("nonsense");

    const char *const missing[] = {"not_there"};
    text.fragment = shader_find("compose.frag");
    text.uniforms = missing;
    text.uniform_count = 1;
    EXPECT_STATUS(gpu_program_open(&p, g, &text), ERR_DEVICE);
    EXPECT_SAYS("not_there");
    gpu_close(&g);
}

static void test_sizes_beyond_driver_are_refused(void **state)
{
    (void)state;
    struct gpu *g;
    EXPECT_STATUS(gpu_open(&g), OK);
    struct gpu_texture *t;
    EXPECT_STATUS(
        gpu_texture_open(&t, g, &(struct gpu_texture_layout){GPU_R8, gpu_max_size(g) + 1, 1, GPU_NEAREST}, NULL),
        ERR_DEVICE);
    EXPECT_TRUE(t == NULL);
    struct gpu_target *target;
    EXPECT_STATUS(gpu_target_open(&target, g, 1, gpu_max_size(g) + 1), ERR_DEVICE);
    EXPECT_TRUE(target == NULL);
    EXPECT_STATUS(gpu_check(g), OK); // no error is left pending
    gpu_close(&g);
}

// A texture's pixels are drawn into a target unchanged, top row first.
static void test_pixels_are_unchanged(void **state)
{
    (void)state;
    enum { W = 7, H = 5 };
    struct gpu *g;
    EXPECT_STATUS(gpu_open(&g), OK);
    uint8_t rgb[W * H * 3], rgba[W * H * 4];
    for (int i = 0; i < W * H * 3; i++)
        rgb[i] = (uint8_t)(i * 37 + 11);
    static const char *const samplers[] = {"camera_image", "actor_image", "shadow_image"};
    struct gpu_program_source text = {.name = "compose",
                                      .vertex = shader_find("fullscreen.vert"),
                                      .fragment = shader_find("compose.frag"),
                                      .samplers = samplers,
                                      .sampler_count = 3};
    struct gpu_program *program;
    struct gpu_mesh *mesh;
    struct gpu_texture *texture;
    struct gpu_target *target, *empty;
    EXPECT_STATUS(gpu_program_open(&program, g, &text), OK);
    EXPECT_STATUS(fullscreen_mesh_open(&mesh, g), OK);
    EXPECT_STATUS(gpu_texture_open(&texture, g, &(struct gpu_texture_layout){GPU_RGB8, W, H, GPU_NEAREST}, rgb), OK);
    EXPECT_STATUS(gpu_target_open(&target, g, W, H), OK);
    EXPECT_STATUS(gpu_target_open(&empty, g, W, H), OK);
    gpu_draw(&(struct gpu_job){.target = target,
                               .program = program,
                               .mesh = mesh,
                               .textures = {texture, gpu_target_texture(empty), gpu_target_texture(empty)}});
    EXPECT_STATUS(gpu_target_read(target, rgba), OK);
    for (int i = 0; i < W * H; i++)
        for (int c = 0; c < 4; c++)
            EXPECT_INT(rgba[4 * i + c], c < 3 ? rgb[3 * i + c] : 255);
    gpu_target_close(&empty);
    gpu_target_close(&target);
    gpu_texture_close(&texture);
    gpu_mesh_close(&mesh);
    gpu_program_close(&program);
    gpu_close(&g);
}

// A job draws nothing outside its box, and clearing removes all.
static void test_jobs_draw_only_within_their_boxes(void **state)
{
    (void)state;
    enum { W = 9, H = 6 };
    static const struct gpu_box boxes[] = {{2, 1, 3, 4}, {-3, 4, 5, 9}, {7, -2, 9, 3}, {20, 20, 2, 2}};
    const struct gpu_program_source text = {.name = "one colour",
                                            .vertex = shader_find("fullscreen.vert"),
                                            .fragment = "#version 300 es\nprecision highp float;\nout vec4 color;\n"
                                                        "void main() { color = vec4(1.0); }\n"};
    struct gpu *g;
    struct gpu_program *program;
    struct gpu_mesh *mesh;
    struct gpu_target *target;
    uint8_t rgba[W * H * 4];
    EXPECT_STATUS(gpu_open(&g), OK);
    EXPECT_STATUS(gpu_program_open(&program, g, &text), OK);
    EXPECT_STATUS(fullscreen_mesh_open(&mesh, g), OK);
    EXPECT_STATUS(gpu_target_open(&target, g, W, H), OK);
    for (int used = 0; used <= (int)COUNT_OF(boxes); used++) { // the last without a box
        for (int b = 0; b < used; b++)
            gpu_draw(&(struct gpu_job){.target = target, .program = program, .mesh = mesh, .within = boxes[b]});
        if (used == COUNT_OF(boxes))
            gpu_draw(&(struct gpu_job){.target = target, .program = program, .mesh = mesh});
        EXPECT_STATUS(gpu_target_read(target, rgba), OK);
        for (int i = 0; i < W * H; i++) {
            bool inside = used == COUNT_OF(boxes);
            for (int b = 0; b < used; b++)
                inside |= i % W >= boxes[b].left && i % W < boxes[b].left + boxes[b].width && i / W >= boxes[b].top &&
                          i / W < boxes[b].top + boxes[b].height;
            EXPECT_INT(rgba[4 * i], inside ? 255 : 0);
        }
        gpu_target_clear(target);
        EXPECT_STATUS(gpu_target_read(target, rgba), OK);
        for (int i = 0; i < W * H * 4; i++)
            EXPECT_INT(rgba[i], 0);
    }
    gpu_target_close(&target);
    gpu_mesh_close(&mesh);
    gpu_program_close(&program);
    gpu_close(&g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_shader_compiles),
        cmocka_unit_test(test_broken_shaders_are_refused),
        cmocka_unit_test(test_sizes_beyond_driver_are_refused),
        cmocka_unit_test(test_pixels_are_unchanged),
        cmocka_unit_test(test_jobs_draw_only_within_their_boxes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
