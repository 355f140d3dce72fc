// A take as an MCAP file of JSON messages in Foxglove's well-known schemas: what its panels for images, for 3D and for
// plots open. Field names and units are those of the schemas' documentation (docs.foxglove.dev, schemas).
#include "base/text.h"
#include "capture/export.h"
#include "formats/mcap.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- schemas

#define OBJECT(fields) "{\"type\":\"object\",\"properties\":{" fields "}}"
#define ARRAY(item)    "{\"type\":\"array\",\"items\":" item "}"
#define INTEGER        "{\"type\":\"integer\"}"
#define NUMBER         "{\"type\":\"number\"}"
#define STRING         "{\"type\":\"string\"}"
#define BOOLEAN        "{\"type\":\"boolean\"}"
#define BYTES          "{\"type\":\"string\",\"contentEncoding\":\"base64\"}"
#define TIME           OBJECT("\"sec\":" INTEGER ",\"nsec\":" INTEGER)
#define STAMPED        "\"timestamp\":" TIME ",\"frame_id\":" STRING
#define VECTOR         OBJECT("\"x\":" NUMBER ",\"y\":" NUMBER ",\"z\":" NUMBER)
#define QUATERNION     OBJECT("\"x\":" NUMBER ",\"y\":" NUMBER ",\"z\":" NUMBER ",\"w\":" NUMBER)
#define POSE           OBJECT("\"position\":" VECTOR ",\"orientation\":" QUATERNION)
#define COLOR          OBJECT("\"r\":" NUMBER ",\"g\":" NUMBER ",\"b\":" NUMBER ",\"a\":" NUMBER)

static const char image_schema[] = OBJECT(STAMPED ",\"data\":" BYTES ",\"format\":" STRING);
static const char raw_image_schema[] = OBJECT(STAMPED ",\"width\":" INTEGER ",\"height\":" INTEGER
                                                      ",\"encoding\":" STRING ",\"step\":" INTEGER ",\"data\":" BYTES);
static const char calibration_schema[] =
    OBJECT(STAMPED ",\"width\":" INTEGER ",\"height\":" INTEGER ",\"distortion_model\":" STRING
                   ",\"D\":" ARRAY(NUMBER) ",\"K\":" ARRAY(NUMBER) ",\"R\":" ARRAY(NUMBER) ",\"P\":" ARRAY(NUMBER));
static const char transforms_schema[] = OBJECT(
    "\"transforms\":" ARRAY(OBJECT("\"timestamp\":" TIME ",\"parent_frame_id\":" STRING ",\"child_frame_id\":" STRING
                                   ",\"translation\":" VECTOR ",\"rotation\":" QUATERNION)));
static const char scene_schema[] = OBJECT(
    "\"deletions\":" ARRAY(OBJECT("\"timestamp\":" TIME ",\"type\":" INTEGER ",\"id\":" STRING)) ",\"entities\":" ARRAY(
        OBJECT(
            STAMPED
            ",\"id\":" STRING ",\"lifetime\":" TIME ",\"frame_locked\":" BOOLEAN
            ",\"metadata\":" ARRAY(OBJECT("\"key\":" STRING ",\"value\":" STRING)) ",\"arrows\":" ARRAY(OBJECT(
                "\"pose\""
                ":" POSE)) ",\"cubes\":" ARRAY(OBJECT("")) ","
                                                           "\"spheres\":" ARRAY(OBJECT(
                                                               "\"pose\":" POSE ",\"size\":" VECTOR
                                                               ",\"color\":" COLOR)) ","
                                                                                     "\"cylinders\":" ARRAY(OBJECT("")) ",\"lines\":" ARRAY(
                                                                                         OBJECT(
                                                                                             "\"type\":" INTEGER
                                                                                             ",\"pose\":" POSE
                                                                                             ",\"thickness\":" NUMBER
                                                                                             ",\"scale_"
                                                                                             "invariant\":" BOOLEAN
                                                                                             ",\"points\":" ARRAY(
                                                                                                 VECTOR) ",\"color\""
                                                                                                         ":" COLOR
                                                                                                         ",\"colors\""
                                                                                                         ":" ARRAY(COLOR) ",\"indices\":" ARRAY(
                                                                                                             INTEGER))) ","
                                                                                                                        "\"triangles"
                                                                                                                        "\":" ARRAY(OBJECT("")) ",\"texts\":" ARRAY(
                                                                                                                            OBJECT(
                                                                                                                                "\"po"
                                                                                                                                "se\""
                                                                                                                                ":" POSE)) ",\"models\":" ARRAY(OBJECT("")))));
static const char joints_schema[] = OBJECT(STAMPED ",\"joints\":{\"type\":\"object\",\"additionalProperties\":" OBJECT(
    "\"x\":" NUMBER ",\"y\":" NUMBER ",\"z\":" NUMBER ",\"confidence\":" NUMBER ",\"sigma_m\":" NUMBER) "}");

enum channel { COLOR_IMAGE, COLOR_LENS, DEPTH_IMAGE, DEPTH_LENS, TRANSFORMS, SKELETON, JOINTS, CHANNELS };

static const struct mcap_channel channels[CHANNELS] = {
    [COLOR_IMAGE] = {"/camera/color", "foxglove.CompressedImage", image_schema},
    [COLOR_LENS] = {"/camera/color/calibration", "foxglove.CameraCalibration", calibration_schema},
    [DEPTH_IMAGE] = {"/camera/depth", "foxglove.RawImage", raw_image_schema},
    [DEPTH_LENS] = {"/camera/depth/calibration", "foxglove.CameraCalibration", calibration_schema},
    [TRANSFORMS] = {"/tf", "foxglove.FrameTransforms", transforms_schema},
    [SKELETON] = {"/actor/skeleton", "foxglove.SceneUpdate", scene_schema},
    [JOINTS] = {"/actor/joints", "reenact.Joints", joints_schema},
};

// ---------------------------------------------------------------- messages

struct mcap_export {
    struct take *take;
    struct mcap_writer *writer;
    FILE *text; // of the message that is being written
    char *bytes;
    size_t count;
    int64_t shift_ns; // MCAP's times are not negative
    bool in_world;
};

static enum status begin_message(struct mcap_export *export)
{
    export->text = open_memstream(&export->bytes, &export->count);
    return export->text ? OK : fail(ERR_MEMORY, "no memory for a message");
}

static enum status end_message(struct mcap_export *export, enum channel channel, int64_t time_ns)
{
    const bool written = fclose(export->text) == 0;
    enum status status = written ? OK : fail(ERR_MEMORY, "no memory for a message");
    if (status == OK)
        status = mcap_add(export->writer, (int)channel, time_ns, export->bytes, export->count);
    free(export->bytes);
    return status;
}

static void print_time(const struct mcap_export *export, int64_t time_ns)
{
    fprintf(export->text, "\"timestamp\":{\"sec\":%lld,\"nsec\":%lld}", (long long)(time_ns / 1000000000),
            (long long)(time_ns % 1000000000));
}

static void print_stamp(const struct mcap_export *export, int64_t time_ns, const char *frame)
{
    fputc('{', export->text);
    print_time(export, time_ns);
    fprintf(export->text, ",\"frame_id\":\"%s\"", frame);
}

static void print_vector(FILE *text, const char *name, struct vec3 at)
{
    fprintf(text, "\"%s\":{\"x\":%.6f,\"y\":%.6f,\"z\":%.6f}", name, at.x, at.y, at.z);
}

static enum status add_lens(struct mcap_export *export, enum channel channel, const struct lens *l, int64_t time_ns)
{
    enum status status = l->width ? begin_message(export) : NOTHING;
    if (status != OK)
        return status == NOTHING ? OK : status;
    print_stamp(export, time_ns, channel == COLOR_LENS ? "color" : "depth");
    fprintf(export->text,
            ",\"width\":%d,\"height\":%d,\"distortion_model\":\"plumb_bob\",\"D\":[%.9g,%.9g,%.9g,%.9g,%.9g],"
            "\"K\":[%.9g,0,%.9g,0,%.9g,%.9g,0,0,1],\"R\":[1,0,0,0,1,0,0,0,1],"
            "\"P\":[%.9g,0,%.9g,0,0,%.9g,%.9g,0,0,0,1,0]}",
            l->width, l->height, l->k1, l->k2, l->p1, l->p2, l->k3, l->fx, l->cx, l->fy, l->cy, l->fx, l->cx, l->fy,
            l->cy);
    return end_message(export, channel, time_ns);
}

static enum status add_color(struct mcap_export *export, int64_t frame, int64_t time_ns)
{
    const uint8_t *jpeg;
    size_t count;
    enum status status = take_read_jpeg(export->take, frame, &jpeg, &count);
    if (status == OK)
        status = begin_message(export);
    if (status != OK)
        return status == NOTHING ? OK : status;
    print_stamp(export, time_ns, "color");
    fputs(",\"format\":\"jpeg\",\"data\":\"", export->text);
    html_put_base64(export->text, jpeg, count);
    fputs("\"}", export->text);
    return end_message(export, COLOR_IMAGE, time_ns);
}

static enum status add_depth(struct mcap_export *export, int64_t frame, int64_t time_ns)
{
    const struct lens *l = &take_calibration(export->take)->depth;
    struct take_images images;
    enum status status = take_read(export->take, frame, TAKE_DEPTH, &images);
    if (status != OK || !images.depth)
        return status;
    status = begin_message(export);
    if (status != OK)
        return status;
    print_stamp(export, time_ns, "depth");
    fprintf(export->text, ",\"width\":%d,\"height\":%d,\"encoding\":\"16UC1\",\"step\":%d,\"data\":\"", l->width,
            l->height, 2 * l->width);
    html_put_base64(export->text, (const uint8_t *)images.depth, sizeof *images.depth * lens_pixels(l));
    fputs("\"}", export->text);
    return end_message(export, DEPTH_IMAGE, time_ns);
}

static void print_transform(const struct mcap_export *export, int64_t time_ns, const char *parent, const char *child,
                            struct pose parent_from_child)
{
    const struct quat q = parent_from_child.rotation;
    fputc('{', export->text);
    print_time(export, time_ns);
    fprintf(export->text, ",\"parent_frame_id\":\"%s\",\"child_frame_id\":\"%s\",", parent, child);
    print_vector(export->text, "translation", parent_from_child.translation);
    fprintf(export->text, ",\"rotation\":{\"x\":%.9f,\"y\":%.9f,\"z\":%.9f,\"w\":%.9f}}", q.x, q.y, q.z, q.w);
}

// Where the sensor is; of a take without a place, as if it were held level. In frames in which it was not located it
// stays where it was.
static enum status add_transforms(struct mcap_export *export, const struct take_entry *entry, int64_t time_ns)
{
    static const struct pose z_up_from_camera = {{-0.7071067811865476, 0, 0, 0.7071067811865476}, {0, 0, 0}};
    const enum status status = begin_message(export);
    if (status != OK)
        return status;
    fputs("{\"transforms\":[", export->text);
    if (!export->in_world || entry->located) {
        print_transform(export, time_ns, "world", "color",
                        export->in_world ? entry->world_from_camera : z_up_from_camera);
        fputc(',', export->text);
    }
    print_transform(export, time_ns, "color", "depth", take_calibration(export->take)->color_from_depth);
    fputs("]}", export->text);
    return end_message(export, TRANSFORMS, time_ns);
}

static bool is_known(const struct skeleton *skeleton, enum joint joint)
{
    return skeleton->confidence[joint] > 0 && v3_finite(skeleton->joint[joint]);
}

static void print_spheres(FILE *text, const struct skeleton *skeleton)
{
    bool any = false;
    fputs("\"spheres\":[", text);
    for (int j = 0; j < JOINT_COUNT; j++) {
        if (!is_known(skeleton, (enum joint)j))
            continue;
        fputs(any ? ",{\"pose\":{" : "{\"pose\":{", text);
        print_vector(text, "position", skeleton->joint[j]);
        fprintf(text,
                ",\"orientation\":{\"x\":0,\"y\":0,\"z\":0,\"w\":1}},\"size\":{\"x\":0.05,\"y\":0.05,\"z\":0.05},"
                "\"color\":{\"r\":1,\"g\":%.1f,\"b\":0.1,\"a\":1}}",
                skeleton->confidence[j] >= 0.75f ? 0.8 : 0.3); // guessed joints are redder
        any = true;
    }
    fputc(']', text);
}

static void print_bones(FILE *text, const struct skeleton *skeleton)
{
    bool any = false;
    fputs("\"lines\":[{\"type\":2,\"pose\":{\"position\":{\"x\":0,\"y\":0,\"z\":0},\"orientation\":{\"x\":0,\"y\":0,"
          "\"z\":0,\"w\":1}},\"thickness\":0.02,\"scale_invariant\":false,\"points\":[",
          text);
    for (int p = 0; p < PART_COUNT; p++) {
        const struct part_ends *ends = &part_ends[p];
        if (!is_known(skeleton, ends->from) || !is_known(skeleton, ends->to))
            continue;
        const struct vec3 from = skeleton->joint[ends->from], to = skeleton->joint[ends->to];
        fprintf(text, "%s{\"x\":%.6f,\"y\":%.6f,\"z\":%.6f},{\"x\":%.6f,\"y\":%.6f,\"z\":%.6f}", any ? "," : "", from.x,
                from.y, from.z, to.x, to.y, to.z);
        any = true;
    }
    fputs("],\"color\":{\"r\":0.2,\"g\":0.7,\"b\":1,\"a\":1},\"colors\":[],\"indices\":[]}]", text);
}

// Without a person the last one is taken away.
static enum status add_skeleton(struct mcap_export *export, const struct take_entry *entry, int64_t time_ns)
{
    const enum status status = begin_message(export);
    if (status != OK)
        return status;
    if (entry->has_skeleton) {
        fputs("{\"deletions\":[],\"entities\":[", export->text);
        print_stamp(export, time_ns, "color");
        fputs(",\"id\":\"actor\",\"lifetime\":{\"sec\":0,\"nsec\":0},\"frame_locked\":true,\"metadata\":[],"
              "\"arrows\":[],\"cubes\":[],\"cylinders\":[],\"triangles\":[],\"texts\":[],\"models\":[],",
              export->text);
        print_spheres(export->text, &entry->skeleton);
        fputc(',', export->text);
        print_bones(export->text, &entry->skeleton);
        fputs("}]}", export->text);
    } else {
        fputs("{\"entities\":[],\"deletions\":[{", export->text);
        print_time(export, time_ns);
        fputs(",\"type\":0,\"id\":\"actor\"}]}", export->text);
    }
    return end_message(export, SKELETON, time_ns);
}

// In the world's axes where the sensor was located, else in the camera's.
static enum status add_joints(struct mcap_export *export, const struct take_entry *entry, int64_t time_ns)
{
    if (!entry->has_skeleton || (export->in_world && !entry->located))
        return OK;
    const enum status status = begin_message(export);
    if (status != OK)
        return status;
    const struct skeleton s =
        export->in_world ? skeleton_transform(entry->world_from_camera, &entry->skeleton) : entry->skeleton;
    const char *separator = "";
    print_stamp(export, time_ns, export->in_world ? "world" : "color");
    fputs(",\"joints\":{", export->text);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const double sigma_m = joint_sigma_m(&s, (enum joint)j);
        if (!is_known(&s, (enum joint)j))
            continue;
        fprintf(export->text, "%s\"%s\":{\"x\":%.6f,\"y\":%.6f,\"z\":%.6f,\"confidence\":%.2f", separator,
                joint_name((enum joint)j), s.joint[j].x, s.joint[j].y, s.joint[j].z, (double)s.confidence[j]);
        if (isfinite(sigma_m))
            fprintf(export->text, ",\"sigma_m\":%.6f", sigma_m);
        fputc('}', export->text);
        separator = ",";
    }
    fputs("}}", export->text);
    return end_message(export, JOINTS, time_ns);
}

// ---------------------------------------------------------------- the file

static enum status add_lenses(struct mcap_export *export, int64_t time_ns)
{
    const struct calibration *calibration = take_calibration(export->take);
    const enum status status = add_lens(export, COLOR_LENS, &calibration->color, time_ns);
    return status == OK ? add_lens(export, DEPTH_LENS, &calibration->depth, time_ns) : status;
}

// Each image on its own, so that a damaged one costs no other. *damaged: whether there was one.
static enum status add_images(struct mcap_export *export, int64_t frame, int64_t time_ns, bool *damaged)
{
    enum status color = add_color(export, frame, time_ns);
    if (color != OK && color != ERR_CORRUPT)
        return color;
    const enum status depth = add_depth(export, frame, time_ns);
    *damaged = color == ERR_CORRUPT || depth == ERR_CORRUPT;
    return depth == ERR_CORRUPT ? OK : depth;
}

static enum status add_frame(struct mcap_export *export, int64_t frame, bool *damaged)
{
    const struct take_entry *entry = take_entry(export->take, frame);
    const int64_t time_ns = entry->time_ns + export->shift_ns;
    enum status status = frame ? OK : add_lenses(export, time_ns);
    if (status == OK)
        status = add_transforms(export, entry, time_ns);
    if (status == OK)
        status = add_images(export, frame, time_ns, damaged);
    if (status == OK)
        status = add_skeleton(export, entry, time_ns);
    return status == OK ? add_joints(export, entry, time_ns) : status;
}

enum status export_mcap(struct take *take, FILE *out, const struct progress_watch *watch, int64_t *damaged)
{
    const int64_t frames = take_frame_count(take), first_ns = frames ? take_entry(take, 0)->time_ns : 0;
    struct mcap_export e = {.take = take, .shift_ns = first_ns < 0 ? -first_ns : 0, .in_world = take_is_located(take)};
    enum status status = mcap_open(&e.writer, out, channels, CHANNELS);
    *damaged = 0;
    for (int64_t i = 0; i < frames && status == OK; i++) {
        bool faulty = false;
        status = progress_continue(watch, (double)i / (double)frames) ? add_frame(&e, i, &faulty) : NOTHING;
        *damaged += faulty;
    }
    return mcap_close(&e.writer, status);
}
