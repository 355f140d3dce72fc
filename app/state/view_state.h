// The view state: what the screen shows, and how it reacts to input. All behaviour of the app without a window, a
// camera or a clock. Pure; times are nanoseconds of a monotonic clock, passed in.
//
// Buttons, keys and the game pad call view_state_do; fingers on the image view_state_gesture; the camera
// view_state_on_camera. The drawing code reads the fields.
#pragma once
#include "app/state/live_state.h"
#include "app/state/orbit.h"
#include "app/state/playback_clock.h"
#include "base/level_of_detail.h"

// ---------------------------------------------------------------- room state

// What of the room the page for watching shows beside the actor: names at the things, one thing's card, the search with
// its arrow, the map, and the recorded views behind an orbit. Pure.

enum { ROOM_FILTER_BYTES = 32, ROOM_NOTHING = -1 };

struct room_state {
    int thing_count; // of the recording
    bool has_place;  // there is something to draw a map of
    bool has_views;  // the place holds views with colour and depth

    bool names;                     // labels stand at the things
    bool map;                       // the map is beside the picture
    bool filmed;                    // recorded views are behind an orbit
    int card;                       // the thing whose card is open; ROOM_NOTHING
    int wanted;                     // the thing that an arrow leads to; ROOM_NOTHING
    char filter[ROOM_FILTER_BYTES]; // what was typed to search by
    bool enter;                     // the first thing that the filter leaves is meant
    struct orbit map_orbit;         // the map's viewpoint
};

struct room_state room_state_start(void);

// Text for the filter, which does not begin with a blank. False: there is nothing new.
bool room_state_type(struct room_state *state, const char *text);

// An arrow leads to that thing; to none if it does already.
void room_state_want(struct room_state *state, int thing);

// How visible a label is, 0 to 1: it fades with the distance (metres) and with the standard deviation of where the
// thing stands; a thing that was not found where it stood is fainter still.
double room_label_opacity(double distance_m, double sigma_m, bool gone);

// ---------------------------------------------------------------- view state

enum view_page {
    PAGE_TAKES, // choose a take
    PAGE_WATCH,
    PAGE_LIVE,    // do the move beside the actor; view_state.live says how far
    PAGE_TROUBLE, // nothing can be watched; view_state.trouble says why
};

enum view_sheet {
    SHEET_NONE,
    SHEET_LAYERS,
    SHEET_SPEED,
    SHEET_THINGS, // find a thing by its name
    SHEET_CARD,   // what is known of room.card
    SHEET_LIVE,   // of PAGE_LIVE: how it is done
};

enum view_action {
    DO_NOTHING,
    DO_PLAY_PAUSE,
    DO_STEP_BACK,
    DO_STEP_ON,
    DO_TO_START,
    DO_TO_END,
    DO_SLOWER,
    DO_FASTER,
    DO_LOOP,
    DO_MIRROR,
    DO_ORBIT,     // switch between the camera and the orbit
    DO_SEE_FRONT, // of an orbit: from which side the actor is seen
    DO_SEE_SIDE,
    DO_SEE_BACK,
    DO_SEE_ABOVE,
    DO_SEE_START, // as it was when the take was opened
    DO_SKELETON,
    DO_SOURCES,
    DO_INSET,
    DO_FRAME_GRAPH,
    DO_THEME,
    DO_TEXT_SIZE, // the next
    DO_DETAIL,    // + enum detail
    DO_DETAIL_LAST = DO_DETAIL + DETAIL_COUNT - 1,
    DO_MOVE,            // begin or end moving the actor
    DO_RESET_PLACEMENT, // put the actor back to where the take was filmed
    DO_SCREENSHOT,
    DO_LAYERS,
    DO_SPEED, // open or close the sheet
    DO_BACK,  // leave, in this order: sheet, moving, page, program
    DO_TAKES,
    DO_FULLSCREEN,
    DO_NAMES,  // labels at the things
    DO_MAP,    // the map beside the picture
    DO_FILMED, // the recorded views behind an orbit
    DO_THINGS, // open or close the sheet to find a thing
    DO_QUIT,
    DO_PREVIOUS,
    DO_NEXT,
    DO_CHOOSE,  // on the page of takes
    DO_COMPARE, // there: choose two takes to be compared, or not; DO_MAP and DO_SCREENSHOT mean this there
    // On PAGE_LIVE; there the actions above mean what live_action_of says. The marks and KEEP also trim on PAGE_WATCH.
    DO_SCREEN,
    DO_PACE,
    DO_OVER,
    DO_GHOST,
    DO_HANDS_FREE,
    DO_MARK_FROM,
    DO_MARK_TO,
    DO_KEEP,
    DO_COUNT, // + enum live_group
    DO_COUNT_LAST = DO_COUNT + LIVE_GROUPS - 1,
    DO_TOLERANCE, // + enum live_group
    DO_TOLERANCE_LAST = DO_TOLERANCE + LIVE_GROUPS - 1,
    DO_COUNT_MARKED,
    DO_COUNT_ALL,
};

// What is known of the camera at an instant.
struct view_camera {
    bool requested;      // the app was started with a camera
    bool has_place;      // the recording has a place to localise in
    bool has_tags;       // and the place has tags
    bool take_located;   // the sensor was located in it, so that the actor has a position there
    bool seeing;         // images arrive
    int64_t received_ns; // when the last one arrived
    int64_t frame;       // number of the newest processed image; 0: none
    bool placed;         // its pose was found
    const char *trouble; // the camera's error sentence; "" none; borrowed for the call
    int32_t moved_tags;  // how many tags are not where the place has them
    int32_t first_moved; // the lowest of their numbers
};

// Where the actor stands: a shift over the floor from where the take was filmed, and a rotation about the vertical
// through the actor.
struct placement {
    double x_m, y_m, yaw_rad;
    bool mirrored;
};

// The part of a take that stays when its ends are cut off. Only where it is offered, as after filming.
struct view_trim {
    bool offered;
    int64_t from_ns, to_ns; // of the take
    bool wanted;            // asked for: the owner of the viewer cuts
};

// Two takes that are compared: chosen on PAGE_TAKES one after the other, shown by live's summary.
enum take_choice_asked { CHOICE_NONE, CHOICE_REFERENCE, CHOICE_ATTEMPT };
struct take_choice {
    enum take_choice_asked asked; // which one is chosen next
    int reference, attempt;       // numbers of takes
    int attempt_count;            // of the other recording, in which the attempt is; 0: it is in the same one
    bool wanted;                  // both are chosen: the owner compares them, and says so to live
};

struct view_state {
    enum view_page page;
    enum view_sheet sheet;
    const char *trouble; // the sentence of PAGE_TROUBLE; borrowed

    int take, take_count; // the selected take, and of how many, of those that are listed
    int own_count;        // takes of the recording; take_count but while another recording's are listed
    int take_columns;     // as the page of takes shows them; 0: one
    bool take_wanted;     // `take` has to be opened
    struct take_choice compare;
    struct playback_clock playback;
    bool scrubbing, was_playing;

    bool orbiting;        // the view is the orbit's, else the camera's
    bool orbit_requested; // by the user; else only for want of a camera image
    struct orbit orbit, orbit_start;
    double facing_rad; // the azimuth of an orbit that sees the actor from the front at this instant
    int64_t tapped_ns; // when the image was tapped last; a second tap soon after it is a double one
    struct placement placement;
    bool moving; // fingers move the actor, not the view
    bool skeleton, sources, inset, frame_graph, dark, fullscreen;
    double text_size; // of view_text_sizes; everything on the screen grows with it
    bool developer;   // what only developers understand is offered, too
    int list_steps;   // up or down in the list that is open; who draws it takes them
    bool screenshot_wanted, quit;
    struct view_trim trim;

    struct live_state live; // of PAGE_LIVE
    struct room_state room; // of PAGE_WATCH

    struct view_camera camera;
    char camera_trouble[512]; // a copy of the last view_camera.trouble
    const char *problem;      // what is wrong with the recording while it plays; NULL: nothing; borrowed
    bool frozen;              // the camera is open and sends no images
    enum detail detail;       // what the actor is drawn as
    double error_px;          // permitted error of DETAIL_AUTO, pixels
    double presence;          // the actor's opacity, 0..1: fades while the camera's pose is not known
    double avatar_progress;   // progress of building the take's avatar, 0..1
    bool avatar_shown;        // the avatar is drawn, no longer what the sensor saw
    double crossfade;         // 0..1: from what the sensor saw to the avatar
    bool ever_placed;
    int64_t placed_ns;     // when the camera's pose was last known
    int64_t last_input_ns; // of the last input, for hiding the controls while playing
    char notice[160];      // shown until notice_until_ns
    bool notice_warns;
    int64_t notice_until_ns;
    int64_t tag_moved_ns;       // since when the camera has reported moved tags; 0: it reports none
    int32_t tag_moved_notified; // view_camera.first_moved of the last notice; -1: none yet
    int64_t now_ns;             // of the last view_state_tick
    bool changed;               // there is something new to draw; viewer_draw clears it
};

// The speeds to choose from, from PLAYBACK_SLOWEST to PLAYBACK_FASTEST.
enum { VIEW_SPEEDS = 8 };
extern const double view_speeds[VIEW_SPEEDS];

// Text sizes to choose from; 1: as it was designed.
enum { VIEW_TEXT_SIZES = 3 };
extern const double view_text_sizes[VIEW_TEXT_SIZES];

struct view_state view_state_start(int take_count, bool dark, int64_t now_ns);

// A take was opened: its length, and the orbit to start with.
void view_state_open_take(struct view_state *state, int64_t length_ns, int64_t frames, const struct orbit *orbit,
                          int64_t now_ns);
void view_state_fail(struct view_state *state, const char *sentence); // to PAGE_TROUBLE; the sentence is borrowed

void view_state_do(struct view_state *state, enum view_action action, int64_t now_ns);

// Whether text is typed: a thing is looked for by its name.
bool view_state_types(const struct view_state *state);

// What an action means on PAGE_LIVE. False: nothing there.
bool live_action_of(enum view_action action, enum live_phase phase, enum live_action *out);

// Fingers on the image; the gesture's lengths are shares of its height. at: the points of the floor under the first
// finger before and after, metres, world axes; NULL where it points to no floor.
struct floor_drag {
    double from_x, from_y, to_x, to_y;
};
void view_state_gesture(struct view_state *state, const struct gesture *gesture, const struct floor_drag *at,
                        int64_t now_ns);
void view_state_wheel(struct view_state *state, double notches, int64_t now_ns);

// Fingers on the map, as above; notches of the wheel over it.
void view_state_map_gesture(struct view_state *state, const struct gesture *gesture, double notches, int64_t now_ns);

// What is known of a thing is shown, or no more.
void view_state_open_card(struct view_state *state, int thing, int64_t now_ns);
// An arrow leads to it; the sheet closes.
void view_state_find_thing(struct view_state *state, int thing, int64_t now_ns);

// The timeline is held at that share of its length, or (held false) released.
void view_state_scrub(struct view_state *state, bool held, double share, int64_t now_ns);
void view_state_set_speed(struct view_state *state, double speed, int64_t now_ns);
void view_state_set_text_size(struct view_state *state, double size, int64_t now_ns);
void view_state_set_error(struct view_state *state, double error_px);
void view_state_set_yaw(struct view_state *state, double yaw_rad);
void view_state_choose_take(struct view_state *state, int take); // to be opened, or as compare.asked says
// Two takes are to be compared, the attempt one of another recording's attempt_count takes, or of the same one's (0).
// Where there is one alone it is chosen.
void view_state_compare(struct view_state *state, int attempt_count);
bool view_state_lists_other(const struct view_state *state); // the other recording's takes

void view_state_on_camera(struct view_state *state, const struct view_camera *camera, int64_t now_ns);
void view_state_set_problem(struct view_state *state, const char *sentence); // NULL: resolved
void view_state_set_facing(struct view_state *state, double facing_rad);
void view_state_set_progress(struct view_state *state, double share);   // of building the avatar, 0..1
void view_state_set_avatar_shown(struct view_state *state, bool shown); // the frame drawn last shows the avatar
void view_state_notify(struct view_state *state, const char *notice, int64_t now_ns);
// The same for what went wrong; stays longer.
void view_state_warn(struct view_state *state, const char *notice, int64_t now_ns);
void view_state_on_input(struct view_state *state, int64_t now_ns); // any input: shows the controls

// Advances to now_ns. Returns until when nothing changes by itself: INT64_MAX, or now_ns while something moves.
int64_t view_state_tick(struct view_state *state, int64_t now_ns);

// The app was suspended between the two times.
void view_state_resume(struct view_state *state, int64_t from_ns, int64_t to_ns);

// One sentence on what is wrong or what to do; NULL: nothing. Borrowed until the next call.
const char *view_state_hint(const struct view_state *state);
bool view_state_hint_warns(const struct view_state *state); // it says that something is wrong

// Whether the controls are shown: they hide while the take plays and there is no input.
bool view_state_controls_shown(const struct view_state *state);

// Maps points of the take's world to where they are shown, without the mirroring. pivot: the rotation's centre.
struct pose placement_pose(const struct placement *placement, struct vec3 pivot);
