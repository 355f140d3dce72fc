// Doing the move beside the actor: count-in, the actor's instant while the person follows or keeps up, loops, attempts,
// and the summary afterwards. All behaviour of the live screens without a window, a sensor or a clock. Pure; times are
// nanoseconds, of a monotonic clock where they are called now_ns, else of the take or of the attempt.
//
//     LIVE_READY      the actor stands at the beginning; starts by hand, or by itself once a person is in the picture
//     LIVE_COUNT_IN   3, 2, 1
//     LIVE_DOING      the actor moves, the person is judged
//     LIVE_SUMMARY    the attempt's score and findings; a touched place is played
//
// The owner watches `attempt` (a new number: collect what the sensor says from now on), `finished` (judge the attempt
// of that number) and `keep_wanted`; and tells what the sensor sees by live_state_on_sight, results by
// live_state_on_result.
#pragma once
#include "app/state/orbit.h"

enum live_phase { LIVE_READY, LIVE_COUNT_IN, LIVE_DOING, LIVE_SUMMARY };
enum live_screen {
    LIVE_MIRROR, // the sensor's picture as in a mirror, the actor in it
    LIVE_BESIDE, // both from a common side, which a finger turns
    LIVE_ROOM,   // both in the tablet's camera image
    LIVE_SCREENS
};
enum live_pace { LIVE_FOLLOW, LIVE_KEEP_UP }; // the actor waits for the person; the actor goes on

// What counts of the take, or does not matter, by touch.
enum live_group { GROUP_HEAD, GROUP_TRUNK, GROUP_ARMS, GROUP_LEGS, LIVE_GROUPS };

enum live_action {
    LIVE_DO_START,  // begin, stop, again
    LIVE_DO_SCREEN, // the next screen that there is
    LIVE_DO_PACE,
    LIVE_DO_SLOWER,
    LIVE_DO_FASTER,
    LIVE_DO_OVER, // in the mirror the actor stands over the person, or beside
    LIVE_DO_GHOST,
    LIVE_DO_HANDS_FREE,
    LIVE_DO_MARK_FROM, // the marked part begins here
    LIVE_DO_MARK_TO,   // and ends here
    LIVE_DO_LOOP,      // the marked part, or all of it, again and again
    LIVE_DO_MIRROR,    // the actor left and right exchanged, or as recorded; an attempt that is being made begins again
    LIVE_DO_COUNT,     // + enum live_group: it counts or does not matter; one at least counts
    LIVE_DO_COUNT_LAST = LIVE_DO_COUNT + LIVE_GROUPS - 1,
    LIVE_DO_TOLERANCE, // + enum live_group: its next tolerance
    LIVE_DO_TOLERANCE_LAST = LIVE_DO_TOLERANCE + LIVE_GROUPS - 1,
    LIVE_DO_COUNT_MARKED, // only the marked part counts, whatever is done
    LIVE_DO_COUNT_ALL,    // all of the take counts
    LIVE_DO_KEEP,         // keep the last attempt as a take
    LIVE_DO_BACK_STEP,    // in the summary: play half a second earlier, or later
    LIVE_DO_ON_STEP,
};

// What counts when the person is judged, by touch.
struct live_counting {
    bool counts[LIVE_GROUPS];          // false: does not matter
    double tolerance_deg[LIVE_GROUPS]; // 0: none is given; < 0: the group's parts have different ones
    int64_t from_ns, to_ns;            // only this stretch of the take counts; to_ns 0: all of it
};

// What the sensor says at an instant.
struct live_sight {
    bool seeing;          // frames arrive
    bool located;         // the sensor is, in the place that the take was recorded in
    bool in_place;        // and the person is shown there: not before the end of an attempt in which it was located
    bool ended;           // the sensor is a film, and it is over
    int64_t frame;        // number of the newest frame; 0: none
    bool person;          // is followed in it
    bool second_person;   // is in it, too
    bool judged;          // the two below are known
    int64_t reference_ns; // the instant of the take that the person shows
    double away_rad;      // how far the pose is from the actor's at the instant shown; mean over the body
    const char *trouble;  // one sentence; "": none; borrowed for the call
};

enum { LIVE_ATTEMPTS = 32 };
struct live_result {
    double score; // 0..100
    double sigma; // of the score for the joints' errors, points; NaN: unknown
    double length_s;
    int findings;
    bool compared;    // false: no score: too little of the person was seen, or it is another movement
    int64_t worst_ns; // the moment of the attempt that the summary opens at
};

struct live_state {
    bool present;  // the app was started with a sensor
    bool of_takes; // LIVE_SUMMARY is of two takes that were compared, not of an attempt
    bool has_camera;
    enum live_phase phase;
    enum live_screen screen;
    enum live_pace pace;
    double tempo;
    bool over, ghost, loop, hands_free;
    bool mirrored;                        // the actor is shown, and the person judged, left and right exchanged
    struct live_counting counting;        // what the owner says it is when a take is opened
    bool counting_changed;                // by touch; the owner takes it back
    int64_t length_ns;                    // of the take
    int64_t marked_from_ns, marked_to_ns; // the part that is done: from 0 to length_ns where nothing is marked
    int64_t at_ns;                        // the actor's instant
    bool waits;                           // follow: the actor waits for the person

    int64_t phase_ns;  // when the phase began
    int64_t tick_ns;   // of the last tick
    int64_t end_ns;    // when the actor reached the end; 0: not yet
    int64_t person_ns; // since when the person has been there without a break; 0: not there
    int64_t gone_ns;   // since when not; 0: there
    int64_t second_ns; // when a second person was last seen; 0: never
    int64_t frame_ns;  // when the newest frame was first heard of
    struct live_sight sight;
    char trouble[256];

    int attempt;                               // number of the attempt that is being made or was made last; 0: none
    bool attempt_mirrored;                     // that attempt is judged by the mirrored actor
    int finished;                              // number of the attempt that is to be judged; 0: none yet
    int judged;                                // number of the last one that was
    struct live_result results[LIVE_ATTEMPTS]; // of the last attempts of this sitting, the newest last
    int result_count, results_ever;
    bool too_short;   // the last one was stopped within a second: neither judged nor counted
    bool marks_asked; // the marked part was to be what counts, and there is none
    bool keep_wanted;

    bool reviewing;                       // a place of the attempt is played
    int64_t review_from_ns, review_at_ns; // in the attempt's time
    int64_t review_length_ns;             // of the attempt
    struct orbit orbit;                   // of LIVE_BESIDE and of what is reviewed
};

bool live_state_is_marked(const struct live_state *state); // a part of the take, to be done alone

// The tempos to choose from.
enum { LIVE_TEMPOS = 5 };
extern const double live_tempos[LIVE_TEMPOS];

// Without a sensor all stays as it is: present is false, and nothing below is called.
struct live_state live_state_start(bool has_camera);
// A take was opened; a new sitting begins.
void live_state_open_take(struct live_state *state, int64_t length_ns, const struct orbit *orbit, int64_t now_ns);

void live_state_do(struct live_state *state, enum live_action action, int64_t now_ns);
void live_state_to_ready(struct live_state *state, int64_t now_ns); // leaves the attempt or the summary
// Two takes are to be compared, without a sensor, too: the summary waits for the result, of the number `finished`.
void live_state_compare_takes(struct live_state *state, int64_t now_ns);
void live_state_on_sight(struct live_state *state, const struct live_sight *sight, int64_t now_ns);
// The attempt that was finished has been judged. length_ns: of what was collected.
void live_state_on_result(struct live_state *state, const struct live_result *result, int64_t length_ns,
                          int64_t now_ns);
// Plays the attempt from a little before that instant of it.
void live_state_review(struct live_state *state, int64_t at_ns);

// Advances to now_ns. Returns until when nothing changes by itself: INT64_MAX, or now_ns while something moves.
int64_t live_state_tick(struct live_state *state, int64_t now_ns);

// 3, 2 or 1 while counting in; else 0.
int live_state_count(const struct live_state *state);
const char *live_state_judging(const struct live_state *state); // what is going on until there is a result
// One sentence for the person; NULL: nothing. Borrowed until the next call.
const char *live_state_hint(const struct live_state *state);
bool live_state_hint_warns(const struct live_state *state); // it says that something is wrong
