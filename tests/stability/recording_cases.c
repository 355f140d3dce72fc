// Numbers in a recording that are none: refused when written, and when read from a file that another program wrote.
#include "recording/little_endian.h"
#include "recording/recording_schema.h"
#include "tests/stability/stability.h"
#include "tests/support/scratch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum where {
    FRAME_POSE,
    FRAME_JOINT,
    FRAME_CONFIDENCE,
    FRAME_TIME, // not later than the last
    BODY_RADIUS,
    PLACE_TAG_SIDE,
    PLACE_TAG_POSE,
    PLACE_POINT,
    PLACE_VIEW,
    PLACE_RESIDUAL,
    TAKE_FOCAL,
    TAKE_RELATION,
    WHERE_COUNT
};

static const struct lens small = {.width = 8, .height = 8, .fx = 8, .fy = 8, .cx = 3.5, .cy = 3.5};

// All that a recording holds, with `number` in one place.
struct content {
    struct calibration calibration;
    struct place_tag tag;
    struct place_landmark point;
    struct place_view view;
    struct place place;
    struct take_frame frame[2];
    struct body body;
};

static void fill(struct content *c, enum where where, double number)
{
    *c = (struct content){.calibration = {.color = small, .depth = small, .color_from_depth = POSE_IDENTITY},
                          .tag = {.id = 0, .side_m = 0.2, .world_from_tag = POSE_IDENTITY},
                          .view = {.world_from_camera = POSE_IDENTITY},
                          .body = {.radius_rate = {0.3}}};
    for (int i = 0; i < 2; i++) {
        c->frame[i] = (struct take_frame){
            .time_ns = i * INT64_C(33333333), .world_from_camera = POSE_IDENTITY, .has_skeleton = true};
        for (int j = 0; j < JOINT_COUNT; j++)
            c->frame[i].skeleton.confidence[j] = 1;
    }
    switch (where) {
    case FRAME_POSE: c->frame[1].world_from_camera.translation.x = number; break;
    case FRAME_JOINT: c->frame[1].skeleton.joint[JOINT_NECK].y = number; break;
    case FRAME_CONFIDENCE: c->frame[1].skeleton.confidence[JOINT_NECK] = (float)number; break;
    case FRAME_TIME: c->frame[1].time_ns = (int64_t)number; break;
    case BODY_RADIUS: c->body.radius_rate[1] = number; break;
    case PLACE_TAG_SIDE: c->tag.side_m = number; break;
    case PLACE_TAG_POSE: c->tag.world_from_tag.rotation.w = number; break;
    case PLACE_POINT: c->point.world.z = number; break;
    case PLACE_VIEW: c->view.world_from_camera.translation.z = number; break;
    case PLACE_RESIDUAL: c->place.rms_px = number; break;
    case TAKE_FOCAL: c->calibration.color.fx = number; break;
    case TAKE_RELATION: c->calibration.color_from_depth.translation.x = number; break;
    case WHERE_COUNT: break;
    }
    c->place.calibration = where == TAKE_FOCAL || where == TAKE_RELATION
                               ? (struct calibration){.color = small, .color_from_depth = POSE_IDENTITY}
                               : c->calibration;
    c->place.tags = &c->tag;
    c->place.points = &c->point;
    c->place.views = &c->view;
    c->place.tag_count = c->place.point_count = c->place.view_count = 1;
}

static enum status write_file(const char *path, const struct content *c)
{
    struct recording_writer *w = NULL;
    enum status status = recording_create(&w, path);
    if (status == OK)
        status = recording_put_place(w, &c->place);
    if (status == OK)
        status = recording_begin_take(w, "a", &c->calibration);
    for (int i = 0; i < 2 && status == OK; i++)
        status = recording_add_frame(w, &c->frame[i]);
    if (status == OK)
        status = recording_put_body(w, &c->body);
    if (status == OK)
        status = recording_end_take(w);
    const enum status closed = recording_close(&w);
    return status != OK ? status : closed;
}

// in: where, number. Writing it.
static struct answer ask_writer(const double *in)
{
    struct content c;
    struct scratch folder = scratch_make();
    fill(&c, (enum where)in[0], in[1]);
    const enum status status = write_file(scratch_file(&folder, "a.reenact"), &c);
    struct failure kept;
    failure_keep(&kept, status);
    scratch_remove(&folder);
    return answer_status(failure_restore(&kept), in[1]);
}

// ------------------------------------------------------------- a file that another program wrote

struct patch {
    const char *select, *update;
    size_t offset;
    int column; // of the blob, in both
};

// Binds a row's blobs again, one of them with the number in it, and its checksum. Seals are cleared, as in older files.
static enum status write_row(struct database *db, const char *update, uint8_t *const *blob, const size_t *bytes,
                             int count, uint32_t crc)
{
    struct statement *s = NULL;
    enum status status = statement_open(&s, db, update);
    for (int i = 0; i < count && status == OK; i++)
        statement_bind_blob(s, i + 1, blob[i], bytes[i]);
    if (status == OK) {
        statement_bind_number(s, count + 1, crc);
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

enum { MOST_BLOB = 4096 };

static enum status patch_place(struct database *db, enum where where, double number)
{
    static uint8_t copy[4][MOST_BLOB];
    uint8_t *const blob[4] = {copy[0], copy[1], copy[2], copy[3]};
    size_t bytes[4];
    struct statement *s = NULL;
    enum status status = statement_open(&s, db, "SELECT calibration, residuals, tags, points FROM place");
    if (status == OK)
        status = statement_step(s);
    for (int i = 0; i < 4 && status == OK; i++) {
        const uint8_t *from = statement_blob(s, i, &bytes[i]);
        assert(from && bytes[i] <= MOST_BLOB);
        memcpy(copy[i], from, bytes[i]);
    }
    statement_close(&s);
    put_f64(where == PLACE_RESIDUAL   ? copy[1]
            : where == PLACE_TAG_SIDE ? copy[2] + 4
            : where == PLACE_TAG_POSE ? copy[2] + 4 + 8 + 6 * 8
                                      : copy[3] + 2 * 8,
            number);
    uint32_t crc = 0;
    for (int i = 0; i < 4; i++)
        crc = crc32_of(crc, copy[i], bytes[i]);
    return status != OK ? status
                        : write_row(db, "UPDATE place SET calibration=?, residuals=?, tags=?, points=?, crc=?", blob,
                                    bytes, 4, crc);
}

static enum status patch_view(struct database *db, double number)
{
    uint8_t pose[POSE_BYTES], *const blob[1] = {pose};
    const size_t bytes[1] = {POSE_BYTES};
    struct pose at = POSE_IDENTITY;
    at.translation.z = number;
    put_pose(pose, &at);
    return write_row(db, "UPDATE place_view SET world_from_camera=?, crc=?, seal=NULL", blob, bytes, 1,
                     view_crc(pose, NULL, 0, NULL, 0));
}

static enum status patch_take(struct database *db, const struct content *c)
{
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES], *const blob[2] = {calibration, body};
    const size_t bytes[2] = {CALIBRATION_BYTES, BODY_BYTES};
    put_calibration(calibration, &c->calibration);
    put_body(body, &c->body);
    return write_row(db, "UPDATE take SET calibration=?, body=?, crc=?, seal=NULL", blob, bytes, 2,
                     take_crc("a", calibration, true, 0, body));
}

static enum status patch_frame(struct database *db, const struct content *c)
{
    uint8_t pose[POSE_BYTES], skeleton[SKELETON_BYTES], *const blob[2] = {pose, skeleton};
    const size_t bytes[2] = {POSE_BYTES, SKELETON_BYTES};
    char update[200];
    const struct take_frame *f = &c->frame[1];
    put_pose(pose, &f->world_from_camera);
    put_skeleton(skeleton, &f->skeleton);
    snprintf(update, sizeof update,
             "UPDATE frame SET world_from_camera=?, skeleton=?, crc=?, seal=NULL, time_ns=%lld"
             " WHERE rowid = (SELECT max(rowid) FROM frame)",
             (long long)f->time_ns);
    return write_row(db, update, blob, bytes, 2, frame_crc(f->time_ns, false, pose, skeleton, SKELETON_BYTES, 0));
}

static enum status patch(const char *path, enum where where, double number)
{
    struct content c;
    struct database *db = NULL;
    fill(&c, where, number);
    enum status status = database_open(&db, path, DATABASE_WRITE);
    if (status != OK)
        return status;
    if (where <= FRAME_TIME)
        status = patch_frame(db, &c);
    else if (where == PLACE_VIEW)
        status = patch_view(db, number);
    else if (where == BODY_RADIUS || where >= TAKE_FOCAL)
        status = patch_take(db, &c);
    else
        status = patch_place(db, where, number);
    database_close(&db);
    return status;
}

// Opens everything. NOTHING: what holds the number was left out, and counted.
static enum status read_file(const char *path, enum where where, double *value)
{
    struct recording *r = NULL;
    struct take *take = NULL;
    struct place place = {0};
    struct take_images images;
    enum status status = recording_open(&r, path);
    if (status == OK)
        status = recording_read_place(r, &place);
    if (status == OK)
        status = take_open(&take, r, "a");
    if (status == OK)
        status = take_read(take, take_frame_count(take) - 1, TAKE_COLOR | TAKE_DEPTH, &images);
    const bool lost = status == OK && (take_lost(take) || place.views_lost);
    if (status == OK)
        *value = where == BODY_RADIUS ? take_body(take)->radius_rate[1] : (double)take_frame_count(take);
    take_close(&take);
    place_free(&place);
    recording_free(&r);
    return lost ? NOTHING : status;
}

// in: where, number. Reading it.
static struct answer ask_reader(const double *in)
{
    struct content c;
    double value = 0;
    struct failure kept;
    struct scratch folder = scratch_make();
    const char *path = scratch_file(&folder, "a.reenact");
    fill(&c, WHERE_COUNT, 0);
    enum status status = write_file(path, &c);
    if (status == OK)
        status = patch(path, (enum where)in[0], in[1]);
    assert(status == OK);
    status = read_file(path, (enum where)in[0], &value);
    failure_keep(&kept, status);
    scratch_remove(&folder);
    if (status == OK && (enum where)in[0] == BODY_RADIUS && value == 0)
        return answer_of(ANSWER_UNKNOWN); // not measured
    return answer_status(failure_restore(&kept), value);
}

// The number as the bytes have it.
static struct answer as_it_is(const double *in)
{
    uint8_t bytes[8];
    const uint8_t *at = bytes;
    put_f64(bytes, in[1]);
    return answer_value(get_f64(&at));
}

#define WRITING(what, where, number)                                                                                   \
    {                                                                                                                  \
        "writing " what, "checked when written", ANSWER_ERROR, ask_writer, NULL, as_it_is, .in = { where, number }     \
    }
#define READING(what, where, number)                                                                                   \
    {                                                                                                                  \
        "reading " what, "checked when read", ANSWER_ERROR, ask_reader, NULL, as_it_is, .in = { where, number }        \
    }
#define LEFT_OUT(what, where, number)                                                                                  \
    {                                                                                                                  \
        "reading " what, "checked when read", ANSWER_UNKNOWN, ask_reader, NULL, as_it_is, .in = { where, number }      \
    }

static const struct stability_case cases[] = {
    WRITING("a frame's pose of NaN", FRAME_POSE, NAN),
    WRITING("a joint at infinity", FRAME_JOINT, INFINITY),
    WRITING("a confidence of NaN", FRAME_CONFIDENCE, NAN),
    WRITING("a frame at the time of the last", FRAME_TIME, 0),
    WRITING("a body's radius of NaN", BODY_RADIUS, NAN),
    WRITING("a tag with a side of NaN", PLACE_TAG_SIDE, NAN),
    WRITING("a tag's pose of infinity", PLACE_TAG_POSE, INFINITY),
    WRITING("a landmark at NaN", PLACE_POINT, NAN),
    WRITING("a view's pose of NaN", PLACE_VIEW, NAN),
    WRITING("a place's residual of NaN", PLACE_RESIDUAL, NAN),
    WRITING("a denormal focal length", TAKE_FOCAL, 5e-324),
    WRITING("cameras infinitely far apart", TAKE_RELATION, INFINITY),
    LEFT_OUT("a frame's pose of NaN", FRAME_POSE, NAN),
    LEFT_OUT("a joint at infinity", FRAME_JOINT, INFINITY),
    LEFT_OUT("a confidence of NaN", FRAME_CONFIDENCE, NAN),
    LEFT_OUT("a frame before the last one", FRAME_TIME, -1),
    {"reading a body's radius of infinity", "not measured", ANSWER_UNKNOWN, ask_reader, NULL, as_it_is,
     .in = {BODY_RADIUS, INFINITY}},
    READING("a tag with a side of NaN", PLACE_TAG_SIDE, NAN),
    READING("a tag's pose of infinity", PLACE_TAG_POSE, INFINITY),
    READING("a landmark at NaN", PLACE_POINT, NAN),
    LEFT_OUT("a view's pose of NaN", PLACE_VIEW, NAN),
    READING("a place's residual of infinity", PLACE_RESIDUAL, INFINITY),
    READING("a focal length of 0", TAKE_FOCAL, 0),
    READING("a denormal focal length", TAKE_FOCAL, 5e-324),
    READING("cameras at NaN of each other", TAKE_RELATION, NAN),
};
const struct stability_stage stability_recording = {"recording", cases, COUNT_OF(cases)};
