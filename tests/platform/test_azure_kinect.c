// An Azure Kinect's recording (.mkv), written here by FFmpeg's muxer in k4arecorder's layout: what the source gives of
// it, the lenses against the sensor's own formula, and a sentence for each kind of fault.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/sensors/azure_kinect.h"
#include "platform/sensors/source.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

#include <stdio.h>

// ------------------------------------------------------------- the lens

// Two calibrations of real sensors' kind: normalised cx, cy, fx, fy, then k1 to k6, the distortion's centre, p2, p1.
// Made up, but near published ones.
static const double depth_parameters[14] = {0.5123, 0.4945, 0.4921, 0.4922, 3.1306, 2.3249,  0.1304,
                                            3.4587, 3.3501, 0.6629, 0,      0,      -5.1e-5, 8.1e-5};
static const double color_parameters[14] = {0.4968, 0.5109,  0.4709, 0.6274, 0.7227, -2.8856, 1.6327,
                                            0.6022, -2.7196, 1.5651, 0,      0,      -1.4e-4, 7.8e-4};
static const double mild_parameters[14] = {0.4968, 0.5109, 0.47, 0.6267, 0.08, -0.05, 0.01, 0, 0, 0, 0, 0, 1e-4, -1e-4};
static const double turn_rad = 0.1; // of the colour camera about x, as the sensor's is

static const char *calibration_text(const double color[14], const double depth[14])
{
    static char text[4096];
    const double *lens[2] = {depth, color};
    const char *place[2] = {"D0", "PV0"};
    const int size[2][2] = {{1024, 1024}, {4096, 3072}};
    char *at = text + sprintf(text, "{\"CalibrationInformation\": {\"Cameras\": [");
    for (int i = 0; i < 2; i++) {
        at += sprintf(at,
                      "%s{\"Location\": \"CALIBRATION_CameraLocation%s\", \"SensorWidth\": %d, \"SensorHeight\": %d, "
                      "\"MetricRadius\": 1.74, \"Rt\": {\"Rotation\": [1, 0, 0, 0, %.17g, %.17g, 0, %.17g, %.17g], "
                      "\"Translation\": [%g, %g, %g]}, \"Intrinsics\": {\"ModelParameterCount\": 14, \"ModelType\": "
                      "\"CALIBRATION_LensDistortionModelBrownConrady\", \"ModelParameters\": [",
                      i ? ", " : "", place[i], size[i][0], size[i][1], i ? cos(turn_rad) : 1, i ? sin(turn_rad) : 0,
                      i ? -sin(turn_rad) : 0, i ? cos(turn_rad) : 1, i ? -0.032 : 0, i ? -0.002 : 0, i ? 0.004 : 0);
        for (int j = 0; j < 14; j++)
            at += sprintf(at, "%s%.17g", j ? ", " : "", lens[i][j]);
        at += sprintf(at, "]}}");
    }
    sprintf(at, "], \"InertialSensors\": []}}");
    return text;
}

// The sensor's formula, in pixels of a chip of full[0] x full[1] cropped by left, top.
static struct pixel sensor_pixel(const double v[14], const int full[2], const int crop[2], double x, double y)
{
    const double s = x * x + y * y;
    const double d =
        (1 + v[4] * s + v[5] * s * s + v[6] * s * s * s) / (1 + v[7] * s + v[8] * s * s + v[9] * s * s * s);
    const double u = x * d + v[12] * (s + 2 * x * x) + 2 * v[13] * x * y;
    const double w = y * d + v[13] * (s + 2 * y * y) + 2 * v[12] * x * y;
    return (struct pixel){(u * v[2] + v[0]) * full[0] - crop[0] - 0.5, (w * v[3] + v[1]) * full[1] - crop[1] - 0.5};
}

static struct azure_calibration parse(const double color[14], const int color_size[2], const int depth_size[2])
{
    struct azure_calibration c;
    const char *text = calibration_text(color, depth_parameters);
    EXPECT_STATUS(azure_calibration_parse(text, strlen(text) + 1, "a calibration", color_size, depth_size, &c), OK);
    return c;
}

// The polynomial follows the sensor's formula to a pixel all over the image, and to a third of one on average.
static void test_lenses_are_those_of_the_sensor(void **state)
{
    (void)state;
    const struct {
        int size[2], full[2], crop[2];
    } modes[] = {{{320, 288}, {512, 512}, {96, 90}}, {{640, 576}, {1024, 1024}, {192, 180}}};
    for (size_t m = 0; m < COUNT_OF(modes); m++) {
        struct azure_calibration c = parse(mild_parameters, (const int[2]){1280, 720}, modes[m].size);
        const struct lens *l = &c.lenses.depth;
        EXPECT_TRUE(!c.depth.from && !c.color.from && !c.lenses.registered);
        double worst = 0, sum = 0;
        int count = 0;
        for (int y = 0; y < l->height; y += 16)
            for (int x = 0; x < l->width; x += 16, count++) {
                const struct vec3 ray = lens_ray(l, (struct pixel){x, y});
                const struct pixel at = sensor_pixel(depth_parameters, modes[m].full, modes[m].crop, ray.x, ray.y);
                const double off = sqrt((at.x - x) * (at.x - x) + (at.y - y) * (at.y - y));
                worst = fmax(worst, off);
                sum += off;
            }
        print_message("%d x %d: at most %.2f pixels off, %.3f on average\n", l->width, l->height, worst, sum / count);
        EXPECT_AT_MOST(worst, 1);
        EXPECT_AT_MOST(sum / count, 0.34);
        azure_calibration_free(&c);
    }
}

static void test_the_pose_between_the_cameras(void **state)
{
    (void)state;
    struct azure_calibration c = parse(mild_parameters, (const int[2]){1280, 720}, (const int[2]){320, 288});
    const struct vec3 p = pose_apply(c.lenses.color_from_depth, v3(0.1, 0.2, 2));
    EXPECT_NEAR(p.x, 0.1 - 0.032, 1e-9);
    EXPECT_NEAR(p.y, cos(turn_rad) * 0.2 + sin(turn_rad) * 2 - 0.002, 1e-9);
    EXPECT_NEAR(p.z, -sin(turn_rad) * 0.2 + cos(turn_rad) * 2 + 0.004, 1e-9);
    const struct lens *l = &c.lenses.color; // the mild lens is a polynomial itself
    const struct vec3 ray = v3(0.4, -0.3, 1);
    const struct pixel at = lens_project(l, ray);
    const struct pixel want =
        sensor_pixel(mild_parameters, (const int[2]){1280, 960}, (const int[2]){0, 120}, ray.x, ray.y);
    EXPECT_NEAR(at.x, want.x, 1e-6);
    EXPECT_NEAR(at.y, want.y, 1e-6);
    azure_calibration_free(&c);
}

// What no polynomial follows, colour's poles and wide depth, is resampled to a pinhole: every pixel comes from where
// the sensor's formula puts its ray.
static void test_other_images_are_rectified(void **state)
{
    (void)state;
    enum { W = 1280, H = 720, D = 512 };
    struct azure_calibration c = parse(color_parameters, (const int[2]){W, H}, (const int[2]){D, D});
    EXPECT_TRUE(c.color.from && c.depth.from && lens_is_ideal(&c.lenses.color) && lens_is_ideal(&c.lenses.depth));
    uint8_t *in = malloc(3 * W * H), *out = malloc(3 * W * H);
    uint16_t *near = malloc(2 * D * D), *seen = malloc(2 * D * D);
    for (int i = 0; i < W * H; i++) {
        in[3 * i] = (uint8_t)(i % W / 6);
        in[3 * i + 1] = (uint8_t)(i / W / 3);
        in[3 * i + 2] = 77;
    }
    for (int i = 0; i < D * D; i++)
        near[i] = (uint16_t)(i % D + 512 * (i / D % 100) + 1);
    azure_remap_color(&c.color, in, out);
    azure_remap_depth(&c.depth, near, seen);
    int wrong = 0, outside = 0;
    for (int y = 0; y < H; y += 7)
        for (int x = 0; x < W; x += 7) {
            const struct vec3 ray = lens_ray(&c.lenses.color, (struct pixel){x, y});
            const struct pixel from =
                sensor_pixel(color_parameters, (const int[2]){W, W / 4 * 3}, (const int[2]){0, 120}, ray.x, ray.y);
            const uint8_t *rgb = &out[3 * (y * W + x)];
            if (!rgb[2])
                outside++;
            else
                wrong += fabs(rgb[0] - from.x / 6) > 1.5 || fabs(rgb[1] - from.y / 3) > 1.5;
        }
    EXPECT_INT(wrong, 0);
    EXPECT_AT_MOST(outside, 0.05 * (W / 7) * (H / 7));
    for (int y = 0; y < D; y += 5)
        for (int x = 0; x < D; x += 5) {
            const struct vec3 ray = lens_ray(&c.lenses.depth, (struct pixel){x, y});
            const struct pixel from =
                sensor_pixel(depth_parameters, (const int[2]){D, D}, (const int[2]){0, 0}, ray.x, ray.y);
            const int fx = (int)floor(from.x + 0.5), fy = (int)floor(from.y + 0.5), value = seen[y * D + x];
            if (value && fabs(from.x + 0.5 - fx) > 1e-3 && fabs(from.y + 0.5 - fy) > 1e-3)
                wrong += value != near[fy * D + fx];
        }
    EXPECT_INT(wrong, 0);
    EXPECT_TRUE(seen[D / 2 * D + D / 2] != 0);
    free(in);
    free(out);
    free(near);
    free(seen);
    azure_calibration_free(&c);
}

static void test_calibrations_that_are_none(void **state)
{
    (void)state;
    struct azure_calibration c;
    const int color[2] = {1280, 720}, depth[2] = {320, 288}, odd[2] = {321, 288};
    const struct {
        const char *text, *says;
        const int *depth;
    } cases[] = {
        {"{", "JSON", depth},
        {"{}", "says nothing of the depth camera", depth},
        {calibration_text(mild_parameters, depth_parameters), "no mode of an Azure Kinect gives depth of 321", odd},
        {"{\"CalibrationInformation\": {\"Cameras\": [{\"Location\": \"CALIBRATION_CameraLocationD0\"}]}}",
         "lens model '' is not known", depth},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        EXPECT_STATUS(
            azure_calibration_parse(cases[i].text, strlen(cases[i].text), "a file", color, cases[i].depth, &c),
            ERR_INPUT);
        EXPECT_SAYS(cases[i].says);
        EXPECT_TRUE(!c.color.from && !c.depth.from);
    }
}

// ------------------------------------------------------------- the file

#ifdef REENACT_FFMPEG
#include <libavformat/avformat.h>

enum { COLOR_W = 320, COLOR_H = 180, DEPTH_W = 320, DEPTH_H = 288, STEP_MS = 33, DELAY_MS = 2 };

struct mkv_layout {
    const char *calibration; // NULL: none
    const char *depth_title;
    int frames;
    int without_color; // the frame whose colour is left out; -1: none
    const char *delay; // of depth, nanoseconds; NULL: what it is
};

static void need(bool good, const char *what)
{
    if (!good) {
        print_error("the test's muxer: %s\n", what);
        fail_test();
    }
}

static AVStream *add_track(AVFormatContext *f, const char *name, enum AVCodecID codec, int width, int height)
{
    AVStream *s = avformat_new_stream(f, NULL);
    need(s != NULL, "no stream");
    s->codecpar->codec_type = AVMEDIA_TYPE_VIDEO;
    s->codecpar->codec_id = codec;
    s->codecpar->width = width;
    s->codecpar->height = height;
    s->avg_frame_rate = (AVRational){30, 1};
    char tag[32];
    snprintf(tag, sizeof tag, "K4A_%s_TRACK", name);
    av_dict_set(&s->metadata, "title", name, 0);
    av_dict_set(&s->metadata, tag, "810226436614735475", 0);
    return s;
}

static void add_attachment(AVFormatContext *f, const char *text)
{
    AVStream *s = avformat_new_stream(f, NULL);
    need(s != NULL, "no attachment");
    s->codecpar->codec_type = AVMEDIA_TYPE_ATTACHMENT;
    s->codecpar->codec_id = AV_CODEC_ID_NONE;
    s->codecpar->extradata_size = (int)strlen(text) + 1;
    s->codecpar->extradata = av_mallocz(strlen(text) + 1 + AV_INPUT_BUFFER_PADDING_SIZE);
    memcpy(s->codecpar->extradata, text, strlen(text));
    av_dict_set(&s->metadata, "filename", "calibration.json", 0);
    av_dict_set(&s->metadata, "mimetype", "application/octet-stream", 0);
    av_dict_set(&s->metadata, "K4A_CALIBRATION_FILE", "calibration.json", 0);
}

static AVFormatContext *mkv_begin(const char *path, const struct mkv_layout *layout)
{
    AVFormatContext *f;
    AVDictionary *options = NULL;
    need(avformat_alloc_output_context2(&f, NULL, "matroska", path) >= 0, "no format");
    f->strict_std_compliance = -1; // b16g is no tag of the muxer's list
    AVStream *color = add_track(f, "COLOR", AV_CODEC_ID_MJPEG, COLOR_W, COLOR_H);
    AVStream *depth = add_track(f, layout->depth_title, AV_CODEC_ID_RAWVIDEO, DEPTH_W, DEPTH_H);
    depth->codecpar->codec_tag = MKTAG('b', '1', '6', 'g');
    av_dict_set(&color->metadata, "K4A_COLOR_MODE", "MJPG_720P", 0);
    av_dict_set(&depth->metadata, "K4A_DEPTH_MODE", "NFOV_2X2BINNED", 0);
    if (layout->calibration)
        add_attachment(f, layout->calibration);
    av_dict_set(&f->metadata, "title", "Azure Kinect", 0);
    if (layout->delay)
        av_dict_set(&f->metadata, "K4A_DEPTH_DELAY_NS", layout->delay, 0);
    else
        av_dict_set_int(&f->metadata, "K4A_DEPTH_DELAY_NS", DELAY_MS * 1000000, 0);
    need(avio_open(&f->pb, path, AVIO_FLAG_WRITE) >= 0, "cannot write");
    av_dict_set(&options, "allow_raw_vfw", "1", 0);
    need(avformat_write_header(f, &options) >= 0, "header");
    av_dict_free(&options);
    return f;
}

static void mkv_image(AVFormatContext *f, int stream, int64_t time_ms, const void *bytes, size_t count)
{
    AVPacket *packet = av_packet_alloc();
    need(packet && av_new_packet(packet, (int)count) >= 0, "no packet");
    memcpy(packet->data, bytes, count);
    packet->stream_index = stream;
    packet->pts = packet->dts = av_rescale_q(time_ms, (AVRational){1, 1000}, f->streams[stream]->time_base);
    packet->flags = AV_PKT_FLAG_KEY;
    need(av_interleaved_write_frame(f, packet) >= 0, "image");
    av_packet_free(&packet);
}

static void mkv_depth(AVFormatContext *f, int64_t time_ms, const uint16_t *mm)
{
    static uint8_t bytes[2 * DEPTH_W * DEPTH_H];
    for (int i = 0; i < DEPTH_W * DEPTH_H; i++) {
        bytes[2 * i] = (uint8_t)(mm[i] >> 8);
        bytes[2 * i + 1] = (uint8_t)mm[i];
    }
    mkv_image(f, 1, time_ms, bytes, sizeof bytes);
}

static void mkv_end(AVFormatContext *f)
{
    need(av_write_trailer(f) >= 0, "end");
    avio_closep(&f->pb);
    avformat_free_context(f);
}

static void make_depth(int frame, uint16_t mm[DEPTH_W * DEPTH_H])
{
    struct rng rng = {(uint64_t)frame + 1};
    for (int i = 0; i < DEPTH_W * DEPTH_H; i++)
        mm[i] = i % 9 ? (uint16_t)(rng_uniform(&rng) * 65536) : 0;
}

static uint8_t *make_jpeg(int frame, size_t *count)
{
    static uint8_t rgb[COLOR_W * COLOR_H * 3];
    for (int i = 0; i < COLOR_W * COLOR_H * 3; i++)
        rgb[i] = (uint8_t)(i / 3 % COLOR_W + 13 * frame);
    uint8_t *bytes;
    EXPECT_STATUS(jpeg_encode(rgb, COLOR_W, COLOR_H, 90, &bytes, count), OK);
    return bytes;
}

static void mkv_write(const char *path, const struct mkv_layout *layout)
{
    static uint16_t mm[DEPTH_W * DEPTH_H];
    AVFormatContext *f = mkv_begin(path, layout);
    for (int i = 0; i < layout->frames; i++) {
        size_t count;
        uint8_t *jpeg = make_jpeg(i, &count);
        if (i != layout->without_color)
            mkv_image(f, 0, (int64_t)i * STEP_MS + 1, jpeg, count);
        make_depth(i, mm);
        mkv_depth(f, (int64_t)i * STEP_MS + DELAY_MS + i % 3, mm);
        free(jpeg);
    }
    mkv_end(f);
}

static int make_folder(void **state)
{
    static struct scratch scratch;
    scratch = scratch_make();
    *state = &scratch;
    return 0;
}

static int remove_folder(void **state)
{
    scratch_remove(*state);
    return 0;
}

static const char *uri_of(const struct scratch *scratch, const char *name)
{
    static char uri[600];
    snprintf(uri, sizeof uri, "mkv:%s", scratch_file(scratch, name));
    return uri;
}

static void test_frames_of_a_recording(void **state)
{
    enum { COUNT = 9, WITHOUT = 4 };
    static uint16_t mm[DEPTH_W * DEPTH_H];
    const struct mkv_layout layout = {calibration_text(mild_parameters, depth_parameters), "DEPTH", COUNT, WITHOUT,
                                      NULL};
    mkv_write(scratch_file(*state, "a.mkv"), &layout);
    struct source *s;
    struct frame frame;
    EXPECT_STATUS(source_open(&s, uri_of(*state, "a.mkv"), SOURCE_SENSOR), OK);
    EXPECT_INT(source_calibration(s)->color.width, COLOR_W);
    EXPECT_INT(source_calibration(s)->depth.height, DEPTH_H);
    EXPECT_TRUE(!source_calibration(s)->registered && !source_is_live(s));
    for (int i = 0; i < COUNT; i++) {
        char name[32];
        size_t count;
        uint8_t *jpeg = make_jpeg(i, &count);
        EXPECT_STATUS(source_next(s, &frame), OK);
        snprintf(name, sizeof name, "%04d", i);
        EXPECT_TRUE(!strcmp(frame.name, name));
        EXPECT_INT(frame.time_ns, (int64_t)(i * STEP_MS + DELAY_MS + i % 3) * 1000000);
        make_depth(i, mm);
        EXPECT_TRUE(frame.depth && !memcmp(frame.depth, mm, sizeof mm));
        if (i == WITHOUT)
            EXPECT_TRUE(!frame.color && !frame.jpeg);
        else
            EXPECT_TRUE(frame.color && frame.jpeg_bytes == count && !memcmp(frame.jpeg, jpeg, count));
        free(jpeg);
    }
    EXPECT_STATUS(source_next(s, &frame), NOTHING);
    EXPECT_INT(source_dropped(s), 0);
    source_close(&s);
}

// As if none were written: each image of depth still has its colour.
static void test_delays_that_cannot_be(void **state)
{
    static const char *const delays[] = {"-9223372036854775808", "9223372036854775807", "33333334", "soon"};
    for (size_t i = 0; i < COUNT_OF(delays); i++) {
        struct source *s;
        struct frame frame;
        mkv_write(scratch_file(*state, "delay.mkv"),
                  &(struct mkv_layout){calibration_text(mild_parameters, depth_parameters), "DEPTH", 2, -1, delays[i]});
        EXPECT_STATUS(source_open(&s, uri_of(*state, "delay.mkv"), SOURCE_SENSOR), OK);
        for (int k = 0; k < 2; k++) {
            EXPECT_STATUS(source_next(s, &frame), OK);
            EXPECT_TRUE(frame.depth && frame.color);
        }
        source_close(&s);
    }
}

static void test_faulty_files(void **state)
{
    enum { CUT = 24 };
    struct source *s;
    struct frame frame;
    const char *calibration = calibration_text(mild_parameters, depth_parameters);
    mkv_write(scratch_file(*state, "none.mkv"), &(struct mkv_layout){NULL, "DEPTH", 2, -1, NULL});
    mkv_write(scratch_file(*state, "other.mkv"), &(struct mkv_layout){calibration, "Film", 2, -1, NULL});
    mkv_write(scratch_file(*state, "wrong.mkv"), &(struct mkv_layout){"{\"a\": 1}", "DEPTH", 2, -1, NULL});
    mkv_write(scratch_file(*state, "cut.mkv"), &(struct mkv_layout){calibration, "DEPTH", CUT, -1, NULL});
    scratch_text(*state, "text.mkv", "no film");
    const struct {
        const char *name, *says;
        enum status status;
    } cases[] = {{"none.mkv", "calibration.json", ERR_INPUT},
                 {"other.mkv", "no track DEPTH", ERR_INPUT},
                 {"wrong.mkv", "says nothing of the depth camera", ERR_INPUT},
                 {"text.mkv", "text.mkv is no film of an Azure Kinect (Matroska, .mkv): it is a text file", ERR_INPUT},
                 {"nowhere.mkv", "there is no file", ERR_MISSING}};
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        EXPECT_STATUS(source_open(&s, uri_of(*state, cases[i].name), SOURCE_SENSOR), cases[i].status);
        EXPECT_SAYS(cases[i].says);
        EXPECT_TRUE(!s);
    }
    EXPECT_STATUS(source_open(&s, uri_of(*state, "cut.mkv"), SOURCE_CAMERA), ERR_INPUT);
    EXPECT_SAYS("is no camera");
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(scratch_file(*state, "cut.mkv"), &bytes, &count), OK);
    scratch_write(*state, "cut.mkv", bytes, count * 3 / 5);
    free(bytes);
    EXPECT_STATUS(source_open(&s, uri_of(*state, "cut.mkv"), SOURCE_SENSOR), OK);
    int whole = 0;
    while (source_next(s, &frame) == OK)
        whole++;
    EXPECT_AT_LEAST(whole, CUT / 3);
    EXPECT_AT_MOST(whole, CUT * 3 / 5);
    EXPECT_SAYS("s before its end");
    EXPECT_STATUS(source_next(s, &frame), NOTHING);
    source_close(&s);
}

// The small world as that sensor sees it, recorded by the program: the person is found and stands where it does.
static void test_a_person_is_recorded(void **state)
{
    enum { COUNT = 12 };
    static uint16_t mm[DEPTH_W * DEPTH_H];
    static uint8_t rgb[COLOR_W * COLOR_H * 3];
    struct world_options options = world_default_options();
    options.motion = "still";
    options.plain = true;
    struct world *w;
    EXPECT_STATUS(world_open(&w, &options), OK);
    struct mkv_layout layout = {calibration_text(mild_parameters, depth_parameters), "DEPTH", COUNT, -1, NULL};
    struct azure_calibration c =
        parse(mild_parameters, (const int[2]){COLOR_W, COLOR_H}, (const int[2]){DEPTH_W, DEPTH_H});
    AVFormatContext *f = mkv_begin(scratch_file(*state, "person.mkv"), &layout);
    const struct pose world_from_color = world_sensor_pose(w);
    for (int i = 0; i < COUNT; i++) {
        const double time_s = i / 30.0;
        struct world_shot color = {c.lenses.color, world_from_color, time_s, true};
        struct world_shot depth = {c.lenses.depth, pose_multiply(world_from_color, c.lenses.color_from_depth), time_s,
                                   true};
        EXPECT_STATUS(world_render(w, &color, &(struct world_image){.color = rgb}), OK);
        EXPECT_STATUS(world_render(w, &depth, &(struct world_image){.depth = mm}), OK);
        uint8_t *jpeg;
        size_t count;
        EXPECT_STATUS(jpeg_encode(rgb, COLOR_W, COLOR_H, 90, &jpeg, &count), OK);
        mkv_image(f, 0, (int64_t)i * STEP_MS, jpeg, count);
        mkv_depth(f, (int64_t)i * STEP_MS, mm);
        free(jpeg);
    }
    mkv_end(f);
    char uri[600], made[600], joints[600];
    snprintf(uri, sizeof uri, "%s", uri_of(*state, "person.mkv"));
    snprintf(made, sizeof made, "%s", scratch_file(*state, "made.reenact"));
    snprintf(joints, sizeof joints, "%s", scratch_file(*state, "joints.csv"));
    struct process_result said = PROCESS(PROGRAM_DIR "/reenact-capture", "record", "--sensor", uri, "--out", made,
                                         "--take", "a", "--no-body-points");
    if (said.exit_code)
        print_error("%s\n", said.err);
    EXPECT_INT(said.exit_code, 0);
    said =
        PROCESS(PROGRAM_DIR "/reenact-capture", "export", made, "--take", "a", "--as", "joints-csv", "--out", joints);
    EXPECT_INT(said.exit_code, 0);
    uint8_t *text;
    size_t bytes;
    EXPECT_STATUS(file_read(joints, &text, &bytes), OK);
    const struct skeleton truth = world_joints_in_camera(w, 0, world_from_color);
    int torsos = 0;
    for (char *line = (char *)text; line; line = strchr(line, '\n'), line += line != NULL) {
        double t, x, y, z;
        if (sscanf(line, "%lf,torso,%lf,%lf,%lf", &t, &x, &y, &z) == 4) {
            torsos++;
            const struct vec3 want = truth.joint[JOINT_TORSO];
            EXPECT_AT_MOST(v3_distance(v3(x, y, z), want), 0.15);
        }
    }
    EXPECT_AT_LEAST(torsos, COUNT - 2);
    free(text);
    azure_calibration_free(&c);
    world_close(&w);
}
#endif

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lenses_are_those_of_the_sensor),
        cmocka_unit_test(test_the_pose_between_the_cameras),
        cmocka_unit_test(test_other_images_are_rectified),
        cmocka_unit_test(test_calibrations_that_are_none),
#ifdef REENACT_FFMPEG
        cmocka_unit_test_setup_teardown(test_frames_of_a_recording, make_folder, remove_folder),
        cmocka_unit_test_setup_teardown(test_delays_that_cannot_be, make_folder, remove_folder),
        cmocka_unit_test_setup_teardown(test_faulty_files, make_folder, remove_folder),
        cmocka_unit_test_setup_teardown(test_a_person_is_recorded, make_folder, remove_folder),
#endif
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
