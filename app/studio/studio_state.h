// What the studio's window shows and does next: a state machine from "which sensor" to "kept". Pure: no clock, no
// window, no file; actions come in, commands go out, and the studio runs them and reports back.
//
//   SENSORS -> LIVE -> COUNTDOWN -> RECORDING -> FINISHING -> REVIEW -> LIVE ...        REVIEW <-> PLAYBACK, RENAME
//   LIVE -> ROOM -> ROOM_FINISHING -> ROOM_REVIEW -> LIVE: the empty room is swept
//
// A raised hand starts from LIVE and stops a RECORDING; so do space and the button. A RECORDING may pause. Takes in a
// row are kept without a review. On leaving with a take neither kept nor discarded the user is asked (LEAVING).
//
// Discarding and trimming wait for STUDIO_UNDO_S, and for a take that is being made, before the file is changed: until
// then they can be taken back. Leaving carries them out; a program that ends otherwise leaves the take as it was.
#pragma once
#include "base/status.h"
#include "platform/sensors/source.h"

// ---------------------------------------------------------------- studio rate

// How much a take will take, before there is one: every two seconds one frame is coded as the recorder would code it.

struct studio_rate {
    struct depth_coder *coder;
    int64_t measured_ns;
    double frame_bytes;
};

// Costs some milliseconds where a measurement is due. Without memory the last one stays.
void studio_rate_see(struct studio_rate *rate, const struct frame *frame, const struct calibration *calibration,
                     int64_t now_ns);
void studio_rate_close(struct studio_rate *rate);

// ---------------------------------------------------------------- studio state

enum studio_page {
    STUDIO_SENSORS,
    STUDIO_OPENING, // the sensor is being started
    STUDIO_LIVE,
    STUDIO_COUNTDOWN,
    STUDIO_RECORDING,
    STUDIO_FINISHING, // the last frames are written, the joints smoothed
    STUDIO_REVIEW,
    STUDIO_RENAME,
    STUDIO_PLAYBACK,
    STUDIO_LEAVING,        // whether the take is to be kept, before the program ends
    STUDIO_ROOM,           // the room is being swept
    STUDIO_ROOM_FINISHING, // its map is computed
    STUDIO_ROOM_REVIEW,    // how good it is
    STUDIO_TROUBLE,        // the sensor failed; it is tried again every two seconds
};

enum studio_action {
    STUDIO_START, // the main button, space, or a raised hand: start, or stop
    STUDIO_KEEP,
    STUDIO_DISCARD,
    STUDIO_RETAKE, // discard, and start again immediately
    STUDIO_PLAY,
    STUDIO_EDIT_NAME,
    STUDIO_PAUSE,    // in a take: pause, or go on
    STUDIO_IN_A_ROW, // takes are kept without a review, or no longer
    STUDIO_PURPOSE,  // what takes are for: the next of the three
    STUDIO_MAP_ROOM, // sweep the room
    STUDIO_TRIM,     // cut off the take's ends, at `trim_from_ns` and `trim_to_ns`
    STUDIO_UNDO,     // take back what waits to be discarded or trimmed
    STUDIO_BACK,
    STUDIO_THEME,
    STUDIO_TEXT_SIZE,     // the next
    STUDIO_SENSORS_AGAIN, // look for sensors once more
    STUDIO_QUIT,
};

// For what drives devices and files.
enum studio_command {
    STUDIO_OPEN_SENSOR = 1, // number `sensor`
    STUDIO_LIST_SENSORS,
    STUDIO_BEGIN_TAKE, // named `take`
    STUDIO_END_TAKE,
    STUDIO_DELETE_TAKE,    // `erasing`
    STUDIO_RENAME_TAKE,    // from `take` to `name`
    STUDIO_TRIM_TAKE,      // `erasing`
    STUDIO_CHOOSE_PURPOSE, // `purpose`
    STUDIO_PAUSE_TAKE,
    STUDIO_RESUME_TAKE,
    STUDIO_BEGIN_SWEEP,
    STUDIO_END_SWEEP,  // and compute the map
    STUDIO_DROP_SWEEP, // without a map
    STUDIO_KEEP_ROOM,  // into the file
    STUDIO_DROP_ROOM,
    STUDIO_OPEN_PLAYBACK,
    STUDIO_CLOSE_PLAYBACK,
    STUDIO_TONE,       // of the countdown
    STUDIO_TONE_BEGIN, // the take begins
    STUDIO_TONE_END,
};

enum { STUDIO_PURPOSES = 3, STUDIO_COMMANDS = 8, STUDIO_NAME = 64, STUDIO_COUNTDOWN_S = 5, STUDIO_UNDO_S = 10 };

// A take that is to be discarded, or trimmed to from_ns .. to_ns after its beginning.
enum studio_erasure_kind { ERASES_NOTHING, ERASES_TAKE, ERASES_ENDS };
struct studio_erasure {
    enum studio_erasure_kind kind;
    char take[STUDIO_NAME];
    int64_t from_ns, to_ns;
    int64_t since_ns; // when it was asked for
};

struct studio_state {
    enum studio_page page;
    bool dark, quit, changed;
    bool paused, in_a_row;
    int purpose;      // what takes are for: 0 both, 1 to compare, 2 to watch
    double text_size; // as the viewer's
    int64_t trim_from_ns, trim_to_ns;
    int sensor_count, sensor; // chosen
    int number;               // of the next take
    int kept, discarded;
    struct studio_erasure waiting; // can be taken back
    struct studio_erasure erasing; // of the command that is being run
    int undo_left_s;               // as shown
    int left_s;                    // of the countdown
    int64_t page_ns;               // when the page began
    char take[STUDIO_NAME];        // the take being made or reviewed
    char name[STUDIO_NAME];        // as it is being typed
    char trouble[300];
    char notice[160];
    int64_t notice_ns;
    int64_t looked_ns; // when sensors were last looked for by itself
    enum studio_command queue[STUDIO_COMMANDS];
    int queued;
};

struct studio_state studio_start(bool dark);

void studio_set_sensors(struct studio_state *state, int count, int64_t now_ns); // the list was read
void studio_choose_sensor(struct studio_state *state, int sensor, int64_t now_ns);
void studio_do(struct studio_state *state, enum studio_action action, int64_t now_ns);
// Page RENAME: what is typed, the last character taken back, the name as it is.
void studio_type(struct studio_state *state, const char *text);
void studio_type_back(struct studio_state *state);
void studio_type_done(struct studio_state *state, int64_t now_ns);

// ---- what happened
void studio_sensor_ready(struct studio_state *state, int64_t now_ns);
void studio_take_finishing(struct studio_state *state, int64_t now_ns); // filming is over, smoothing goes on
void studio_take_ready(struct studio_state *state, int64_t frames, int64_t now_ns); // written; 0: nothing to review
void studio_sweep_finishing(struct studio_state *state, int64_t now_ns); // the sweep is over, the map is computed
void studio_sweep_ready(struct studio_state *state, int64_t now_ns);     // its map can be reviewed
void studio_room_not_kept(struct studio_state *state, const char *why, int64_t now_ns); // it can be kept later
void studio_fail(struct studio_state *state, const char *sentence, int64_t now_ns);
void studio_say(struct studio_state *state, const char *sentence, int64_t now_ns); // a notice for some seconds
void studio_renamed(struct studio_state *state, bool done, int64_t now_ns);
// `erasing` was not carried out. again: it may be later, and is tried once more, when it could be taken back meanwhile.
void studio_erasure_failed(struct studio_state *state, const char *why, bool again, int64_t now_ns);

// Of what waits, how many seconds are left to take it back, at least 1; 0: nothing waits.
int studio_undo_left_s(const struct studio_state *state, int64_t now_ns);

int studio_take_number(const char *name); // N of a take that was named "take-N"; 0: it is another name

// Advances the countdown. Returns when to call it again at the latest.
int64_t studio_tick(struct studio_state *state, int64_t now_ns);

// Takes the oldest command. False: none.
bool studio_take_command(struct studio_state *state, enum studio_command *out);
