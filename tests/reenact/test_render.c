// The actor renderer against references in double precision, on synthetic takes: where
// cylinders are drawn, their colours, mutual occlusion, determinism.
#include "tests/support/test.h"

#include "tests/support/painted_person.h"

#include <string.h>

static const double PI = 3.14159265358979323846;

// ---------------------------------------------------------------- the double-precision reference

static const struct body thigh_only = {.radius_rate = {[PART_LEFT_THIGH] = 0.25}};

static struct skeleton only_thigh(struct vec3 hip, struct vec3 knee)
{
    struct skeleton s = {0};
    s.joint[JOINT_LEFT_HIP] = hip;
    s.joint[JOINT_LEFT_KNEE] = knee;
    s.joint[JOINT_NECK] = v3_add(hip, v3(0, -0.6, 0));
    s.confidence[JOINT_LEFT_HIP] = s.confidence[JOINT_LEFT_KNEE] = s.confidence[JOINT_NECK] = 1;
    return s;
}

static void test_cylinders_match_reference(void **state)
{
    (void)state;
    static uint8_t grey[PIXELS * 3];
    memset(grey, 120, sizeof grey);
    struct vec3 hip = v3(0.1, -0.2, 2), knee = v3(-0.1, 0.4, 2.2);
    struct one_frame frame = {.skeleton = only_thigh(hip, knee), .rgb = grey};
    struct painted_take s;
    painted_take_open(&s, &ideal, &frame, 1, &thigh_only);
    struct renderer *p = painted_take_renderer(&s, &bent, DETAIL_PAPER);
    static struct drawn got;
    // Viewers: in front; from the side and close; looking almost along the bone; with the
    // cylinder reaching out of the image; and through the cylinder's near end.
    const struct pose viewers[] = {
        POSE_IDENTITY,
        {quat_from_rotation_vector(v3(0, -1.2, 0)), v3(1.7, 0, 1.6)},
        {quat_from_rotation_vector(v3(1.35, 0.1, 0.2)), v3(-0.4, 1.5, 2.1)},
        {quat_from_rotation_vector(v3(0.1, 0.2, 0.7)), v3(-0.25, 0.3, 1.35)},
        {quat_from_rotation_vector(v3(0.05, 0.3, 0)), v3(0.15, 0.05, 1.95)},
    };
    for (size_t v = 0; v < COUNT_OF(viewers); v++) {
        draw_picture(p, viewers[v], 0, grey, &got);
        struct pose back = pose_inverse(viewers[v]);
        struct vec3 a = pose_apply(back, hip), b = pose_apply(back, knee);
        double radius = 0.25 * v3_distance(a, b);
        long both = 0, either = 0;
        for (int i = 0; i < PIXELS; i++) {
            struct vec3 ray = lens_ray(&bent, (struct pixel){i % W, i / W});
            bool wanted = isfinite(tube_depth(ray, a, b, radius, 0.05)), is = got.actor[4 * i + 3] >= 128;
            both += wanted && is;
            either += wanted || is;
        }
        EXPECT_AT_LEAST(either, 2000);
        double iou = (double)both / (double)either;
        print_message("viewer %zu: %ld pixels, iou %.4f\n", v, either, iou);
        EXPECT_AT_LEAST(iou, 0.997);
    }
    renderer_close(&p);
    painted_take_close(&s);
}

// ---------------------------------------------------------------- a painted person

// From the recording camera's viewpoint, the actor shows the recorded pixels.
static void test_take_is_reproduced(void **state)
{
    (void)state;
    static struct painted image;
    static struct drawn got;
    static uint8_t green[PIXELS * 3];
    for (int i = 0; i < PIXELS; i++)
        green[3 * i + 1] = 200;
    struct skeleton s = whole_body(0);
    paint_person(&image, &bent, &s, &whole_measures);
    struct one_frame frame = {s, image.rgb, image.depth, image.mask};
    struct painted_take take;
    painted_take_open(&take, &bent, &frame, 1, &whole_measures);
    for (int detail = DETAIL_PAPER; detail <= DETAIL_FULL; detail++) {
        struct renderer *p = painted_take_renderer(&take, &bent, (enum detail)detail);
        draw_picture(p, POSE_IDENTITY, 0, green, &got);
        EXPECT_INT(got.result.parts, PART_COUNT);
        double sum = 0;
        long count = 0, drawn = 0, person = 0, overlap = 0;
        for (int i = 0; i < PIXELS; i++) {
            bool solid = got.actor[4 * i + 3] == 255;
            drawn += solid;
            person += image.mask[i];
            overlap += solid && image.mask[i];
            // Well inside the mask: JPEG subsamples colour, which mixes it at edges.
            bool inside = image.mask[i] && i > 2 * W && i < PIXELS - 2 * W;
            for (int dy = -2; inside && dy <= 2; dy++)
                for (int dx = -2; dx <= 2; dx++)
                    inside = inside && image.mask[i + dy * W + dx];
            for (int c = 0; c < 3 && inside && solid; c++) {
                double d = (double)got.rgb[3 * i + c] - image.rgb[3 * i + c];
                sum += d * d;
                count++;
            }
        }
        double psnr = 10 * log10(255.0 * 255.0 / (sum / (double)count));
        print_message("%s: %ld pixels of %ld, psnr %.1f dB\n", detail_names[detail], drawn, person, psnr);
        EXPECT_AT_LEAST(count / 3.0, 0.5 * (double)person);
        EXPECT_AT_LEAST(psnr, 45);                           // 47.1 measured
        if (detail == DETAIL_PARTS || detail == DETAIL_FULL) // round ends and all
            EXPECT_AT_LEAST((double)overlap / (double)(drawn + person - overlap), 0.93);
        renderer_close(&p);
    }
    painted_take_close(&take);
}

// In straight alpha the rounding of premultiplied colours grows with 1 / alpha.
static bool magenta(const uint8_t *c)
{
    int rounded = c[3] && c[3] < 255 ? 255 / c[3] : 0;
    return c[0] > c[1] + 100 + rounded && c[2] > c[1] + 100 + rounded;
}

// From all around, at DETAIL_FULL, no pixel of the (magenta) wall behind is on the actor,
// and outside the actor the composed image is the camera image, bit for bit.
static void test_wall_behind_is_never_drawn(void **state)
{
    (void)state;
    static struct painted image[2];
    static struct drawn got;
    static uint8_t green[PIXELS * 3];
    for (int i = 0; i < PIXELS; i++)
        green[3 * i + 1] = (uint8_t)(150 + i % 97);
    struct one_frame frames[2];
    for (int i = 0; i < 2; i++) {
        struct skeleton s = whole_body(i * 0.2);
        paint_person(&image[i], &ideal, &s, &whole_measures);
        frames[i] = (struct one_frame){s, image[i].rgb, image[i].depth, image[i].mask};
    }
    struct painted_take take;
    painted_take_open(&take, &ideal, frames, 2, &whole_measures);
    struct renderer *p = painted_take_renderer(&take, &bent, DETAIL_FULL);
    long leaked = 0, solid = 0, touched = 0;
    for (int v = 0; v < 12; v++) {
        double a = v * PI / 6;
        struct pose viewer = {quat_from_rotation_vector(v3(0, a, 0)), v3(-2.4 * sin(a), 0, 2.5 - 2.4 * cos(a))};
        draw_picture(p, viewer, v * 3000000, green, &got);
        for (int i = 0; i < PIXELS; i++) {
            solid += got.actor[4 * i + 3] == 255;
            leaked += got.actor[4 * i + 3] > 0 && magenta(got.actor + 4 * i);
            touched += got.actor[4 * i + 3] == 0 && memcmp(got.rgb + 3 * i, green + 3 * i, 3);
        }
    }
    EXPECT_AT_LEAST(solid, 12 * 3000);
    EXPECT_INT(leaked, 0);
    EXPECT_INT(touched, 0);
    renderer_close(&p);
    painted_take_close(&take);
}

// Two limbs, recorded apart, red and blue, shown crossed: the nearer one occludes the other,
// from either side.
static void test_nearer_part_occludes_farther(void **state)
{
    (void)state;
    static uint8_t halves[PIXELS * 3], grey[PIXELS * 3];
    memset(grey, 128, sizeof grey);
    for (int i = 0; i < PIXELS; i++) {
        halves[3 * i] = i % W < W / 2 ? 220 : 20;
        halves[3 * i + 1] = 20;
        halves[3 * i + 2] = i % W < W / 2 ? 20 : 220;
    }
    const struct body body = {.radius_rate = {[PART_LEFT_THIGH] = 0.1, [PART_RIGHT_THIGH] = 0.1}};
    struct skeleton apart = {0}, crossed = {0};
    const enum joint used[] = {JOINT_NECK, JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE};
    for (size_t i = 0; i < COUNT_OF(used); i++)
        apart.confidence[used[i]] = crossed.confidence[used[i]] = 1;
    apart.joint[JOINT_NECK] = crossed.joint[JOINT_NECK] = v3(0, -0.8, 2);
    apart.joint[JOINT_LEFT_HIP] = v3(0.4, -0.3, 2);
    apart.joint[JOINT_LEFT_KNEE] = v3(0.4, 0.3, 2);
    apart.joint[JOINT_RIGHT_HIP] = v3(-0.4, -0.3, 2);
    apart.joint[JOINT_RIGHT_KNEE] = v3(-0.4, 0.3, 2);
    crossed.joint[JOINT_LEFT_HIP] = v3(-0.2, -0.2, 1.85); // blue, nearer to the first viewer
    crossed.joint[JOINT_LEFT_KNEE] = v3(0.2, 0.2, 1.85);
    crossed.joint[JOINT_RIGHT_HIP] = v3(0.2, -0.2, 2.15);
    crossed.joint[JOINT_RIGHT_KNEE] = v3(-0.2, 0.2, 2.15);
    const struct one_frame frames[] = {{.skeleton = apart, .rgb = halves}, {.skeleton = crossed}};
    struct painted_take take;
    painted_take_open(&take, &ideal, frames, 2, &body);
    static struct drawn got;
    for (int detail = DETAIL_PAPER; detail <= DETAIL_FULL; detail++) {
        struct renderer *p = painted_take_renderer(&take, &ideal, (enum detail)detail);
        const uint8_t *middle = got.rgb + 3 * (H / 2 * W + W / 2);
        draw_picture(p, POSE_IDENTITY, 40000000, grey, &got);
        EXPECT_INT(got.result.parts, 2);
        EXPECT_INT(got.result.shown, 1);
        EXPECT_AT_LEAST(middle[2] - middle[0], 150);
        draw_picture(p, (struct pose){quat_from_rotation_vector(v3(0, PI, 0)), v3(0, 0, 4)}, 40000000, grey, &got);
        EXPECT_AT_LEAST(middle[0] - middle[2], 150);
        renderer_close(&p);
    }
    painted_take_close(&take);
}

static void test_deterministic(void **state)
{
    (void)state;
    static struct painted image;
    static struct drawn first, second, other;
    struct skeleton s = whole_body(0.1);
    paint_person(&image, &ideal, &s, &whole_measures);
    struct one_frame frame = {s, image.rgb, image.depth, image.mask};
    struct painted_take take;
    painted_take_open(&take, &ideal, &frame, 1, &whole_measures);
    const struct pose viewer = {quat_from_rotation_vector(v3(0, 0.6, 0)), v3(-1.3, 0, 0.5)};
    for (int detail = DETAIL_PAPER; detail <= DETAIL_AUTO; detail++) {
        struct renderer *p = painted_take_renderer(&take, &bent, (enum detail)detail);
        draw_picture(p, viewer, 0, image.rgb, &first);
        renderer_close(&p);
        gpu_close(&take.gpu); // another context, and another image drawn before
        EXPECT_STATUS(gpu_open(&take.gpu), OK);
        p = painted_take_renderer(&take, &bent, (enum detail)detail);
        draw_picture(p, POSE_IDENTITY, 0, image.rgb, &other);
        draw_picture(p, viewer, 0, image.rgb, &second);
        renderer_close(&p);
        EXPECT_INT(memcmp(first.rgb, second.rgb, sizeof first.rgb), 0);
        EXPECT_INT(memcmp(first.actor, second.actor, sizeof first.actor), 0);
        EXPECT_TRUE(memcmp(first.rgb, other.rgb, sizeof first.rgb) != 0);
    }
    painted_take_close(&take);
}

static long actor_pixels(const struct drawn *d)
{
    long n = 0;
    for (int i = 0; i < PIXELS; i++)
        n += d->actor[4 * i + 3] > 0;
    return n;
}

// Nothing to draw: unknown joints, parts never measured, long after the end, behind the
// camera, no length, an image without a pose. The composed image is then the camera image.
static void test_no_actor_leaves_image_unchanged(void **state)
{
    (void)state;
    static struct painted image;
    static struct drawn got;
    struct skeleton s = whole_body(0), half = s;
    paint_person(&image, &ideal, &s, &whole_measures);
    half.confidence[JOINT_LEFT_KNEE] = 0; // takes thigh and shin with it
    half.joint[JOINT_LEFT_KNEE] = v3(NAN, NAN, NAN);
    half.joint[JOINT_RIGHT_HAND] = half.joint[JOINT_RIGHT_ELBOW];
    struct body body = whole_measures;
    body.radius_rate[PART_HEAD] = 0;
    const struct one_frame frames[] = {{s, image.rgb, image.depth, image.mask}, {.skeleton = half}};
    struct painted_take take;
    painted_take_open(&take, &ideal, frames, 2, &body);
    for (int detail = DETAIL_PAPER; detail <= DETAIL_FULL; detail++) {
        struct renderer *p = painted_take_renderer(&take, &ideal, (enum detail)detail);
        draw_picture(p, POSE_IDENTITY, 0, image.rgb, &got);
        EXPECT_INT(got.result.parts, PART_COUNT - 1);
        draw_picture(p, POSE_IDENTITY, 40000000, image.rgb, &got);
        // A knee that is unknown for a moment is inpainted, but not at DETAIL_PAPER.
        EXPECT_INT(got.result.parts, PART_COUNT - (detail == DETAIL_PAPER ? 4 : 2));
        EXPECT_AT_LEAST(actor_pixels(&got), 1000);
        draw_picture(p, POSE_IDENTITY, 5000000000, image.rgb, &got);
        EXPECT_INT(got.result.shown, -1);
        EXPECT_INT(actor_pixels(&got), 0);
        EXPECT_INT(memcmp(got.rgb, image.rgb, sizeof got.rgb), 0);
        draw_picture(p, (struct pose){{0, 0, 0, 1}, {0, 0, 6}}, 0, image.rgb, &got);
        EXPECT_INT(got.result.parts, 0);
        EXPECT_INT(memcmp(got.rgb, image.rgb, sizeof got.rgb), 0);
        draw_picture(p, POSE_IDENTITY, 0, image.rgb, &got);
        EXPECT_STATUS(renderer_draw_background(p, image.rgb), OK);
        EXPECT_STATUS(renderer_read(p, got.rgb), OK);
        EXPECT_STATUS(renderer_read_actor(p, got.actor), OK);
        EXPECT_INT(actor_pixels(&got), 0);
        EXPECT_INT(memcmp(got.rgb, image.rgb, sizeof got.rgb), 0);
        struct renderer_view nowhere = {.world_from_camera = {{0, 0, 0, 1}, {NAN, 0, 0}}, .color = image.rgb};
        EXPECT_STATUS(renderer_draw(p, &nowhere, &got.result), ERR_INPUT);
        renderer_close(&p);
    }
    painted_take_close(&take);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cylinders_match_reference),
        cmocka_unit_test(test_take_is_reproduced),
        cmocka_unit_test(test_wall_behind_is_never_drawn),
        cmocka_unit_test(test_nearer_part_occludes_farther),
        cmocka_unit_test(test_deterministic),
        cmocka_unit_test(test_no_actor_leaves_image_unchanged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
