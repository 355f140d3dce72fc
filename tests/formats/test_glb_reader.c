// A model is read as it was written; broken ones are refused with a sentence, whatever byte is broken.
#include "tests/support/test.h"

#include "app/place/place_things.h"
#include "formats/glb_reader.h"
#include "tests/support/random.h"
#include "tests/support/room_rehearsal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SEED = 7 };

static void test_a_model_is_read(void **state)
{
    (void)state;
    uint8_t *bytes;
    size_t count;
    struct glb_model m;
    room_model(&bytes, &count);
    EXPECT_STATUS(glb_read(bytes, count, &m), OK);
    EXPECT_INT(m.corner_count, 5 * 24 * 12);
    EXPECT_INT(m.part_count, 1);
    EXPECT_NEAR(m.high[0] - m.low[0], 0.3, 1e-6);
    EXPECT_NEAR(m.high[1] - m.low[1], 0.12, 1e-3);
    EXPECT_NEAR(m.parts[0].color[0], 0.6, 1e-6);
    for (int i = 0; i < m.corner_count; i++) {
        const float *n = m.corners[i].normal;
        EXPECT_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-4);
    }
    glb_model_free(&m);
    free(bytes);
}

static void test_broken_models_are_refused(void **state)
{
    (void)state;
    uint8_t *bytes;
    size_t count;
    struct glb_model m;
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    room_model(&bytes, &count);
    for (size_t n = 0; n < count; n += 1 + n / 20) // cut off
        if (glb_read(bytes, n, &m) == OK)
            glb_model_free(&m);
    int refused = 0;
    for (int i = 0; i < 1500; i++) { // bytes changed, most of them in the description
        uint8_t *changed = malloc(count);
        memcpy(changed, bytes, count);
        for (int k = 0; k < 3; k++)
            changed[(size_t)rng_between(&rng, 0, i % 4 ? 1400 : (double)count - 1)] =
                (uint8_t)rng_between(&rng, 0, 256);
        if (glb_read(changed, count, &m) == OK)
            glb_model_free(&m);
        else
            refused++;
        free(changed);
    }
    print_message("%d of 1500 refused\n", refused);
    EXPECT_AT_LEAST(refused, 500);
    EXPECT_STATUS(glb_read((const uint8_t *)"glTF", 4, &m), ERR_INPUT);
    free(bytes);
}

// A model of a description alone.
static enum status read_described(const char *text, struct glb_model *m)
{
    const size_t length = strlen(text), padded = (length + 3) & ~(size_t)3, count = 20 + padded;
    uint8_t *bytes = malloc(count);
    const uint32_t numbers[4] = {2, (uint32_t)count, (uint32_t)padded, 0x4e4f534a};
    memset(bytes, ' ', count);
    memcpy(bytes, "glTF", 4);
    memcpy(bytes + 4, numbers, sizeof numbers); // little-endian, as all machines are that this runs on
    memcpy(bytes + 20, text, length);
    const enum status status = glb_read(bytes, count, m);
    free(bytes);
    return status;
}

// What would take minutes to look through.
static void test_long_descriptions_are_refused(void **state)
{
    (void)state;
    enum { PRIMITIVES = 5000 };
    struct glb_model m;
    char *text = malloc((2 << 20) + 200);
    char *at =
        text + sprintf(text, "{\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":["
                             "{\"mode\":1}");
    for (int i = 0; i < PRIMITIVES; i++)
        at += sprintf(at, ",{\"mode\":1}");
    strcpy(at, "]}]}");
    EXPECT_STATUS(read_described(text, &m), ERR_INPUT);
    EXPECT_SAYS("more than 4096 nodes and primitives");
    memset(text, ' ', 1 << 20);
    strcpy(text + (1 << 20), "{}");
    EXPECT_STATUS(read_described(text, &m), ERR_INPUT);
    EXPECT_SAYS("longer than");
    EXPECT_STATUS(read_described("{\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"children\":[0]}]}", &m), ERR_INPUT);
    EXPECT_SAYS("no tree");
    free(text);
}

static void test_ellipsoids(void **state)
{
    (void)state;
    struct vec3 axes[3];
    const struct quat q = quat_from_rotation_vector(v3(0.4, -0.7, 0.2));
    const struct covariance3 own = {4e-4, 0, 0, 1e-4, 0, 9e-4}, turned = covariance3_rotate(q, &own);
    covariance_ellipsoid(&turned, axes);
    EXPECT_NEAR(covariance_largest_sigma(&turned), 0.03, 1e-9);
    EXPECT_NEAR(v3_length(axes[0]), 2.7955 * 0.03, 1e-6);
    EXPECT_NEAR(v3_length(axes[2]), 2.7955 * 0.01, 1e-6);
    EXPECT_NEAR(fabs(v3_dot(v3_unit(axes[0]), quat_rotate(q, v3(0, 0, 1)))), 1, 1e-9);
    EXPECT_NEAR(v3_dot(axes[0], axes[1]), 0, 1e-9);
    const struct covariance3 none = {0, 0, 0, 0, 0, 0};
    EXPECT_NEAR(covariance_largest_sigma(&none), 0, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_model_is_read),
        cmocka_unit_test(test_broken_models_are_refused),
        cmocka_unit_test(test_long_descriptions_are_refused),
        cmocka_unit_test(test_ellipsoids),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
