// The tables of a recording and the binary layout of their blobs, shared by writer, reader, verify and repair; internal
// to this folder. docs/format.md specifies the same. Pure but for the last three functions.
#pragma once
#include "platform/files/compress.h"
#include "platform/files/database.h"
#include "recording/recording.h"

// ---------------------------------------------------------------- exact schema

// Whether a file has exactly the tables that these programs make, as it must have to be written to: a rule in it of
// another hand (ON CONFLICT REPLACE, UNIQUE, CHECK, DEFAULT, COLLATE, an index, a trigger, a computed column) decides
// what a row that is added does to those that are there, or takes time without end.

// Any order of the columns behind `id`, and older files' fewer columns, are good. ERR_CORRUPT, with a sentence that
// names the first thing that is not as made; ERR_IO, ERR_MEMORY of reading.
MUST_CHECK enum status exact_schema_check(struct database *db);

// ---------------------------------------------------------------- recording schema

enum {
    RECORDING_APPLICATION = 0x5265656e,           // "Reen", SQLite's application_id
    CALIBRATION_REGISTERED = 2 * (2 * 4 + 9 * 8), // where that byte is
    CALIBRATION_BYTES = CALIBRATION_REGISTERED + 1 + 7 * 8,
    POSE_BYTES = 7 * 8,
    SKELETON_BYTES = JOINT_COUNT * (3 * 8 + 4),
    JOINT_ERROR_BYTES = JOINT_COUNT * 6 * 2,
    BODY_BYTES = 8 + PART_COUNT * 8,
    RESIDUAL_BYTES = 2 * 8,
    TAG_BYTES = 4 + 8 + POSE_BYTES + 8 + 4,
    POINT_BYTES = 3 * 8 + 32,
    POINT_ERROR_BYTES = 6 * 4,
    TAG_ERROR_BYTES = 21 * 4,
    POINT_SIDE_BYTES = 3 * 4,
    TAKE_NAME_BYTES = 200,
    TAKE_NOTE_BYTES = 2000,
    PLACE_ITEMS_MAX = 2000000,      // tags, points or views: keeps every blob below DATABASE_BLOB_MAX
    RECORDING_METRES_MAX = 1000000, // any place on Earth is nearer to another that a sensor sees; chosen by hand
    BODY_RADIUS_RATE_MAX = 100,     // a part's radius over its length: no body has 2; chosen by hand
};

// A frame's row id: the take's id and the frame's number in it; its images have the same.
enum { FRAME_NUMBER_MAX = 0x7fffffff, TAKE_ID_MAX = 0x7ffffffe };
// More frames than a take can have come from damage. Read so, a row's checksum or seal no longer matches.
static inline int64_t frame_count_of(int64_t stated) { return stated > FRAME_NUMBER_MAX ? FRAME_NUMBER_MAX : stated; }
static inline bool take_id_is_valid(int64_t take) { return take >= 1 && take <= TAKE_ID_MAX; }
static inline int64_t frame_key(int64_t take, int64_t number)
{
    assert(take_id_is_valid(take) && number >= 0 && number <= FRAME_NUMBER_MAX);
    return take * ((int64_t)1 << 32) + number;
}

extern const char *const recording_tables; // CREATE TABLE ...
// Covariances and viewing directions of the place's landmarks and tags, and the joints' covariances. Older files get
// the place's tables with their next place, and joint_error when they are opened to add to them.
#define OPTIONAL_TABLES                                                                                                \
    "CREATE TABLE IF NOT EXISTS point_error(id INTEGER PRIMARY KEY, covariances BLOB, crc INTEGER);"                   \
    "CREATE TABLE IF NOT EXISTS tag_error(id INTEGER PRIMARY KEY, covariances BLOB, crc INTEGER);"                     \
    "CREATE TABLE IF NOT EXISTS point_side(id INTEGER PRIMARY KEY, directions BLOB, crc INTEGER);"
#define JOINT_ERROR_TABLE                                                                                              \
    "CREATE TABLE IF NOT EXISTS joint_error(id INTEGER PRIMARY KEY, covariances BLOB, crc INTEGER, seal INTEGER);"
// What is kept of a take's preparation (prepared.h); made when it is first kept.
#define PREPARED_TABLE                                                                                                 \
    "CREATE TABLE IF NOT EXISTS prepared(id INTEGER PRIMARY KEY, version INTEGER, index_crc INTEGER, data BLOB,"       \
    " crc INTEGER);"
// What is said of each take (recorded_verdict.h); made with the first.
#define VERDICT_TABLE                                                                                                  \
    "CREATE TABLE IF NOT EXISTS verdict(id INTEGER PRIMARY KEY, purpose INTEGER, seen INTEGER, spoilt INTEGER,"        \
    " index_crc INTEGER, lines TEXT, crc INTEGER);"
// What is expected of who does as in the take (recorded_expectation.h); made with the first.
#define EXPECTATION_TABLE                                                                                              \
    "CREATE TABLE IF NOT EXISTS expectation(id INTEGER PRIMARY KEY, numbers BLOB, takes BLOB, crc INTEGER);"
// Things and what is known of them (recorded_things.c), and where a robot was driven (recorded_things.c); made when
// there are such.
#define THING_TABLES                                                                                                   \
    "CREATE TABLE IF NOT EXISTS thing(id INTEGER PRIMARY KEY, name TEXT, url TEXT, etag TEXT, note TEXT, "             \
    "knowledge TEXT, numbers BLOB, sightings INTEGER, gone INTEGER, crc INTEGER);"                                     \
    "CREATE TABLE IF NOT EXISTS thing_content(id INTEGER PRIMARY KEY, thing INTEGER, kind TEXT, bytes BLOB, "          \
    "crc INTEGER);"
#define DRIVE_TABLE "CREATE TABLE IF NOT EXISTS drive(id INTEGER PRIMARY KEY, numbers BLOB, path BLOB, crc INTEGER);"
// Counts the tables of these names (lower case, quoted). Real tables only: a view of such a name could compute without
// end. Names compare as SQLite compares them, which finds a table whose kind or name a damaged byte made "tAble" or a
// blob.
#define COUNT_TABLES(names)                                                                                            \
    "SELECT count(*) FROM sqlite_schema WHERE lower(type) = 'table' AND rootpage > 0 AND lower(name) IN (" names ")"
enum optional_table { OPTIONAL_POINT_ERROR, OPTIONAL_TAG_ERROR, OPTIONAL_POINT_SIDE, OPTIONAL_TABLE_COUNT };

// Columns that older files lack. `seal` is a CRC-32 over the row's id and crc (and what else is named below), so that a
// damaged id is found: crc does not cover it.
enum recording_table { TABLE_PLACE, TABLE_VIEW, TABLE_TAKE, TABLE_FRAME, TABLE_JOINT_ERROR, TABLE_IMAGE, TABLE_COUNT };
// Adds them, and the table joint_error, to a file that is opened to write.
MUST_CHECK enum status recording_add_columns(struct database *db);
// Opens SELECT of the table's columns below, then its optional ones (NULL where the file lacks them), then `tail`.
MUST_CHECK enum status select_open(struct statement **out, struct database *db, enum recording_table table,
                                   const char *tail);
// The same with INSERT, and "OR REPLACE" where `or_replace`; parameters in the order of the columns.
MUST_CHECK enum status insert_open(struct statement **out, struct database *db, enum recording_table table,
                                   bool or_replace);
// Where the optional ones begin.
enum {
    PLACE_VIEWS = 5,
    PLACE_SEAL,
    VIEW_SEAL = 5,
    TAKE_FRAMES = 7,
    TAKE_LOST,
    TAKE_NOTE,
    TAKE_ALIAS,
    TAKE_SEAL,
    FRAME_SEAL = 7,
    JOINT_ERROR_SEAL = 3,
    IMAGE_SEAL = 7
};

// The order of columns in all statements. rowid is id, also where a damaged byte made the table's own SQL text differ.
#define PLACE_COLUMNS       "calibration, residuals, tags, points, crc"
#define VIEW_COLUMNS        "rowid, world_from_camera, depth, color, crc"
#define TAKE_COLUMNS        "rowid, name, calibration, complete, dropped, body, crc"
#define FRAME_COLUMNS       "rowid, time_ns, located, world_from_camera, skeleton, pictures, crc"
#define JOINT_ERROR_COLUMNS "rowid, covariances, crc"
#define IMAGE_COLUMNS       "rowid, mask_crc, depth_crc, color_crc, mask, depth, color"

// One row of the table take.
struct take_row {
    int64_t id;
    char name[TAKE_NAME_BYTES + 1];
    struct calibration calibration;
    bool complete;
    int64_t dropped;
    struct body body;
    int64_t frames; // when it ended; -1: not known (interrupted, or an older file)
    int64_t lost;   // by damage, before this file was made
    char note[TAKE_NOTE_BYTES + 1], alias[TAKE_NAME_BYTES + 1];
    bool out_of_range; // as read: what is not as the format says was replaced, and the rest can be used
};

// The seal columns.
uint32_t row_seal(int64_t id, uint32_t crc);
uint32_t place_seal(uint32_t crc, int64_t views);
uint32_t take_seal(const struct take_row *take, uint32_t crc);
uint32_t image_seal(int64_t id, const int64_t crcs[3]); // of mask, depth, color; 0: none
// Whether the row's seal is `seal`; true where it has none.
bool seal_matches(struct statement *statement, int column, uint32_t seal);

// Binds the row to a statement of insert_open(TABLE_TAKE). `take_row` must outlive its run.
void take_bind(struct statement *row, const struct take_row *take_row, uint8_t calibration[CALIBRATION_BYTES],
               uint8_t body[BODY_BYTES]);

// ERR_INPUT: a take cannot have that name.
MUST_CHECK enum status take_name_check(const char *name);

// The CRC-32 continued with the number's 8 bytes, little-endian.
uint32_t crc32_of_number(uint32_t crc, int64_t value);

// The crc column of a row, over the columns between key and crc, in order.
uint32_t view_crc(const uint8_t *pose, const uint8_t *depth, size_t depth_bytes, const uint8_t *color,
                  size_t color_bytes);
uint32_t take_crc(const char *name, const uint8_t calibration[CALIBRATION_BYTES], bool complete, int64_t dropped,
                  const uint8_t body[BODY_BYTES]);
uint32_t frame_crc(int64_t time_ns, bool located, const uint8_t pose[POSE_BYTES], const uint8_t *skeleton,
                   size_t skeleton_bytes, unsigned images);

void put_pose(uint8_t out[POSE_BYTES], const struct pose *pose);
void get_pose(const uint8_t in[POSE_BYTES], struct pose *out);
void put_calibration(uint8_t out[CALIBRATION_BYTES], const struct calibration *calibration);
void get_calibration(const uint8_t in[CALIBRATION_BYTES], struct calibration *out);
void put_skeleton(uint8_t out[SKELETON_BYTES], const struct skeleton *skeleton);
void get_skeleton(const uint8_t in[SKELETON_BYTES], struct skeleton *out);
// Only the joints' covariances.
void put_joint_error(uint8_t out[JOINT_ERROR_BYTES], const struct skeleton *skeleton);
void get_joint_error(const uint8_t in[JOINT_ERROR_BYTES], struct skeleton *out);
void put_body(uint8_t out[BODY_BYTES], const struct body *body);
void get_body(const uint8_t in[BODY_BYTES], struct body *out);
void put_residuals(uint8_t out[RESIDUAL_BYTES], double rms_px, double rms_m);
void get_residuals(const uint8_t in[RESIDUAL_BYTES], double *rms_px, double *rms_m);
void put_tag(uint8_t out[TAG_BYTES], const struct place_tag *tag);
void get_tag(const uint8_t in[TAG_BYTES], struct place_tag *out);
void put_point(uint8_t out[POINT_BYTES], const struct place_landmark *point);
void get_point(const uint8_t in[POINT_BYTES], struct place_landmark *out);
void put_point_error(uint8_t out[POINT_ERROR_BYTES], const struct place_landmark *point);
void get_point_error(const uint8_t in[POINT_ERROR_BYTES], struct place_landmark *out);
void put_tag_error(uint8_t out[TAG_ERROR_BYTES], const struct place_tag *tag);
void get_tag_error(const uint8_t in[TAG_ERROR_BYTES], struct place_tag *out);
void put_point_side(uint8_t out[POINT_SIDE_BYTES], const struct place_landmark *point);
void get_point_side(const uint8_t in[POINT_SIDE_BYTES], struct place_landmark *out);

// Valid lenses, finite numbers, and no color_from_depth but identity where depth is registered. ERR_INPUT with a
// sentence.
MUST_CHECK enum status calibration_check(const struct calibration *calibration);
bool point_is_finite(const struct place_landmark *point); // and no variance is negative
bool tag_is_finite(const struct place_tag *tag);          // likewise
bool place_is_finite(const struct place *place);          // all of these, and its views' poses and residuals
bool skeleton_has_known_joint(const struct skeleton *skeleton);
bool skeleton_has_covariance(const struct skeleton *skeleton); // of any joint
// The ranges of docs/format.md: finite, a rotation, and within RECORDING_METRES_MAX of the origin.
bool pose_is_valid(struct pose pose);
bool position_is_valid(struct vec3 position);
bool skeleton_is_valid(const struct skeleton *skeleton); // known joints are, and all covariances finite
bool body_is_valid(const struct body *body);             // radii are none, or at most BODY_RADIUS_RATE_MAX lengths

// Number of pixels of the depth image; 0: there is no depth camera.
static inline size_t depth_pixels(const struct calibration *calibration)
{
    return (size_t)calibration->depth.width * (size_t)calibration->depth.height;
}

// Removes the file, its write-ahead log and the log's index, those that exist.
void recording_remove_files(const char *path);

MUST_CHECK enum status recording_raise_schema(struct database *db); // of an older file that is added to
MUST_CHECK enum status recording_make_tables(struct database *db);  // in an empty database
// Checks that a file is a recording (recording_schema.c). ERR_FORMAT: another file type or a newer schema; ERR_CORRUPT:
// tables are missing, or it is opened to write and not exactly as made.
MUST_CHECK enum status recording_check_tables(struct database *db);

// ---------------------------------------------------------------- a change beside the takes

// Changing what a recording holds beside its takes, in one transaction: all of it or nothing.

// Runs `statements` and then insert(db, what). ERR_MISSING, ERR_FORMAT, ERR_IO, ERR_CORRUPT, and what insert returns;
// on error the file is as it was.
MUST_CHECK enum status recording_change(const char *path, const char *statements,
                                        enum status (*insert)(struct database *db, const void *what), const void *what);
