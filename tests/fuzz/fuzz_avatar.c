// What a recording keeps of the actor's model (reenact/avatar/avatar.h), with the right checksums and any
// content: what is read as a model can be drawn and exported. The input is a sequence of edits of a small model's
// bytes: where (two bytes), how many (one), and the new ones.
#include "platform/files/jpeg.h"
#include "reenact/avatar/avatar.h"
#include "reenact/avatar/tsdf.h"
#include "reenact/export/actor_export.h"
#include "reenact/frame/frame_layer.h"
#include "tests/fuzz/fuzz.h"

#include <stdio.h>
#include <string.h>

enum { WIDTH = 32, HEIGHT = 24, FRAMES = 3, POINTS = 4, CORNERS = 12, SIDE = 8 };

static struct recording *recording;
static struct take *take;
static struct take_skeletons *skeletons;
static struct skeleton_track *track;
static struct source_rays *rays;
static uint8_t *whole; // the model's bytes
static size_t whole_bytes;

// ------------------------------------------------------------- a take

static struct skeleton standing(void)
{
    static const double at[JOINT_COUNT][3] = {
        [JOINT_HEAD] = {0, -0.7, 2},
        [JOINT_NECK] = {0, -0.45, 2},
        [JOINT_LEFT_SHOULDER] = {0.2, -0.4, 2},
        [JOINT_LEFT_ELBOW] = {0.25, -0.1, 2},
        [JOINT_LEFT_HAND] = {0.27, 0.15, 2},
        [JOINT_RIGHT_SHOULDER] = {-0.2, -0.4, 2},
        [JOINT_RIGHT_ELBOW] = {-0.25, -0.1, 2},
        [JOINT_RIGHT_HAND] = {-0.27, 0.15, 2},
        [JOINT_TORSO] = {0, -0.2, 2},
        [JOINT_WAIST] = {0, 0, 2},
        [JOINT_LEFT_HIP] = {0.1, 0.1, 2},
        [JOINT_LEFT_KNEE] = {0.1, 0.5, 2},
        [JOINT_LEFT_FOOT] = {0.1, 0.9, 2},
        [JOINT_RIGHT_HIP] = {-0.1, 0.1, 2},
        [JOINT_RIGHT_KNEE] = {-0.1, 0.5, 2},
        [JOINT_RIGHT_FOOT] = {-0.1, 0.9, 2},
    };
    struct skeleton s = {0};
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = v3(at[j][0], at[j][1], at[j][2]);
        s.confidence[j] = 1;
    }
    return s;
}

static void write_take(const char *path)
{
    struct recording_writer *w;
    static uint16_t depth[WIDTH * HEIGHT];
    static uint8_t mask[WIDTH * HEIGHT], rgb[WIDTH * HEIGHT * 3], *jpeg;
    size_t jpeg_bytes;
    struct calibration lenses = {.registered = true, .color_from_depth = POSE_IDENTITY};
    lenses.color = lenses.depth =
        (struct lens){.width = WIDTH, .height = HEIGHT, .fx = 24, .fy = 24, .cx = 15.5, .cy = 11.5};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        mask[i] = i % WIDTH > 12 && i % WIDTH < 19;
        depth[i] = mask[i] ? 1900 : 3000;
        memset(rgb + 3 * i, i % 251, 3);
    }
    FUZZ_CHECK(jpeg_encode(rgb, WIDTH, HEIGHT, 90, &jpeg, &jpeg_bytes) == OK);
    FUZZ_CHECK(recording_create(&w, path) == OK);
    FUZZ_CHECK(recording_begin_take(w, "take", &lenses) == OK);
    for (int i = 0; i < FRAMES; i++) {
        const struct take_frame frame = {.time_ns = i * INT64_C(33333333),
                                         .world_from_camera = POSE_IDENTITY,
                                         .jpeg = jpeg,
                                         .jpeg_bytes = jpeg_bytes,
                                         .depth = depth,
                                         .mask = mask,
                                         .has_skeleton = true,
                                         .skeleton = standing()};
        FUZZ_CHECK(recording_add_frame(w, &frame) == OK);
    }
    struct body body = {.representative_frame = 0};
    for (int p = 0; p < PART_COUNT; p++)
        body.radius_rate[p] = 0.3;
    FUZZ_CHECK(recording_put_body(w, &body) == OK);
    FUZZ_CHECK(recording_close(&w) == OK);
    free(jpeg);
}

// ------------------------------------------------------------- a model

// A tetrahedron in the trunk.
static void make_model(void)
{
    static struct vec3 points[POINTS] = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}};
    static struct vec3 normals[POINTS] = {{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    static int32_t corners[CORNERS] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}, own[POINTS] = {0, 1, 2, 3};
    static int32_t neighbor[CORNERS / 3][3] = {{2, 3, 1}, {0, 3, 2}, {1, 3, 0}, {0, 2, 1}};
    static struct skin_weights skins[POINTS];
    static float color[POINTS][3], time_s[POINTS], at[POINTS][2] = {{1, 1}, {6, 1}, {1, 6}, {6, 6}};
    static uint8_t filled[POINTS], texels[SIDE * SIDE * 3], times[SIDE * SIDE * 4];
    static int64_t frames[1] = {0};
    static struct tsdf_voxel voxels[8];
    struct bone_corrections corrections = bone_corrections_identity();
    struct tsdf tsdf = {.step = 0.1, .size = {2, 2, 2}, .voxels = voxels};
    struct avatar model = {
        .tsdf = &tsdf,
        .surface = {points, normals, corners, POINTS, CORNERS},
        .skins = skins,
        .vertex_colors = {.color = color, .time_s = time_s, .filled = filled},
        .atlas = {{own, at, corners, neighbor, POINTS, CORNERS, SIDE, SIDE}, points, normals, texels, times},
        .joint_errors = joint_noise_prior(),
        .frames = frames,
        .frame_corrections = &corrections,
        .frame_count = 1,
    };
    FUZZ_CHECK(bind_pose_make(&model.bind_pose, take) == OK);
    model.vertex_colors.irradiance.term[0] = 1;
    for (int i = 0; i < POINTS; i++)
        skins[i] = bind_pose_skin_weights(&model.bind_pose, points[i]);
    for (int i = 0; i < 8; i++)
        voxels[i] = (struct tsdf_voxel){i % 2 ? -0.01F : 0.01F, 1, 1};
    FUZZ_CHECK(avatar_pack(&model, &whole, &whole_bytes) == OK);
}

static void close_all(void)
{
    skeleton_track_close(&track);
    take_skeletons_close(&skeletons);
    source_rays_close(&rays);
    take_close(&take);
    recording_free(&recording);
    free(whole);
}

static void open_all(void)
{
    char path[128];
    snprintf(path, sizeof path, "%s", fuzz_path("avatar"));
    write_take(path);
    FUZZ_CHECK(recording_open(&recording, path) == OK && take_open(&take, recording, "take") == OK);
    FUZZ_CHECK(take_skeletons_open(&skeletons, take) == OK && skeleton_track_open(&track, take, skeletons) == OK);
    FUZZ_CHECK(source_rays_open(&rays, take_calibration(take)) == OK);
    make_model();
    atexit(close_all);
}

// ------------------------------------------------------------- what is made of it

static void draw_and_export(const struct avatar *avatar)
{
    struct frame_layer_loader *loader;
    struct frame_layer layer;
    const struct frame_source source = {take, skeletons, rays};
    FUZZ_CHECK(frame_layer_loader_open(&loader, &source, avatar) == OK);
    if (fuzz_said(frame_layer_loader_load(loader, 0, &layer)) == OK)
        frame_layer_free(&layer);
    frame_layer_loader_close(&loader);

    const struct actor_export actor = {take, skeletons, track, avatar, "take", NULL};
    uint8_t *glb;
    size_t bytes;
    if (fuzz_said(actor_export_glb(&actor, &glb, &bytes)) == OK)
        free(glb);
    char *text;
    FILE *out = open_memstream(&text, &bytes);
    FUZZ_CHECK(out != NULL);
    fuzz_said(actor_export_mesh_ply(&actor, 1, out));
    fclose(out);
    free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (!take)
        open_all();
    uint8_t *edited = malloc(whole_bytes);
    FUZZ_CHECK(edited != NULL);
    memcpy(edited, whole, whole_bytes);
    for (size_t i = 0; i + 3 < size;) {
        const size_t at = (size_t)(data[i] | data[i + 1] << 8) % whole_bytes, wanted = data[i + 2] % 33;
        i += 3;
        size_t count = wanted < size - i ? wanted : size - i;
        count = count < whole_bytes - at ? count : whole_bytes - at;
        memcpy(edited + at, data + i, count);
        i += wanted;
    }
    struct avatar avatar;
    const enum status status = fuzz_said(avatar_unpack(&avatar, take, edited, whole_bytes));
    FUZZ_CHECK(size > 3 || status == OK); // as it is, it can be read
    if (status == OK)
        draw_and_export(&avatar);
    avatar_free(&avatar);
    free(edited);
    return 0;
}
