// What the screen shows and what hands have asked for: the whole of the app's
// behaviour without a window, a camera or a clock. Pure.
//
// Buttons, keys and the game pad all end in view_state_do; fingers on the picture in
// view_state_gesture; what the camera knows comes in through view_state_on_camera. What is to be
// drawn is read from the fields.
#pragma once
#include "app/state/gesture.h"
#include "app/state/orbit.h"
#include "app/state/playback_clock.h"

enum view_page {
    PAGE_TAKES, // choose one
    PAGE_WATCH,
    PAGE_TROUBLE, // nothing can be watched; show.trouble says why
};

enum view_sheet { SHEET_NONE, SHEET_LAYERS, SHEET_SPEED };

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
    DO_ORBIT, // between the camera and walking round with a finger
    DO_SKELETON,
    DO_SOURCES,
    DO_INSET,
    DO_FRAME_GRAPH,
    DO_THEME,
    DO_MOVE,            // begin or end moving the actor
    DO_RESET_PLACEMENT, // the actor to where he was filmed
    DO_SCREENSHOT,
    DO_LAYERS,
    DO_SPEED, // open or close the sheet
    DO_BACK,  // one step out: sheet, moving, page, program
    DO_TAKES,
    DO_FULLSCREEN,
    DO_QUIT,
    DO_PREVIOUS,
    DO_NEXT,
    DO_CHOOSE, // on the page of takes
};

// What is known of the camera at an instant.
struct view_camera {
    bool there;          // one was asked for
    bool knows_place;    // the recording has a place to be found in
    bool knows_tags;     // and there are tags in it
    bool seeing;         // pictures come
    int64_t came_ns;     // the last one
    int64_t frame;       // number of the newest located picture; 0: none
    bool placed;         // it was located
    const char *trouble; // the camera's own sentence; "" none; borrowed for the call
    int32_t moved_tags;  // that hang elsewhere than the place has them
    int32_t first_moved; // the lowest number of them
};

// Where the actor stands: moved over the floor from where he was filmed, and turned about himself.
struct placement {
    double x_m, y_m, yaw_rad;
    bool mirrored;
};

struct view_state {
    enum view_page page;
    enum view_sheet sheet;
    const char *trouble; // page trouble's sentence; borrowed

    int take, take_count; // chosen, or about to be
    bool take_wanted;     // `take` has to be opened
    struct playback_clock playback;
    bool scrubbing, was_playing;

    bool orbiting;        // else through the camera
    bool orbit_requested; // by hand; else only because there is no camera to look through
    struct orbit orbit;
    struct placement placement;
    bool moving; // fingers move the actor, not the view
    bool skeleton, sources, inset, frame_graph, dark, fullscreen;
    bool screenshot_wanted, quit;

    struct view_camera camera;
    char camera_trouble[512]; // its sentence, kept: the camera's may be another by now
    const char *problem;      // what is amiss with the recording while it plays; NULL nothing; borrowed
    bool frozen;              // the camera is open and sends nothing
    double error_px;          // that the actor may be wrong by, in the pixels he is drawn with
    double presence;          // of the actor, 0..1: fades while it is not known where he stands
    double prepared;          // the share of the take's preparing that is done; 1: all
    bool avatar_shown;        // what was prepared is being drawn
    double crossfade;         // 0..1: from the plain actor to the prepared one
    bool ever_placed;
    int64_t placed_ns;     // last time it was known
    int64_t last_input_ns; // last touch, for hiding the controls while playing
    char notice[160];      // passes after a while
    bool notice_warns;
    int64_t notice_until_ns;
    int64_t tag_moved_ns;       // since when the camera has known tags to be moved; 0: it does not
    int32_t tag_moved_notified; // the first of those last told of; -1: none was
    int64_t now_ns;             // of the last view_state_tick
    bool changed;               // there is something new to draw; the drawer clears it
};

struct view_state view_state_start(int take_count, bool dark, int64_t now_ns);

// A take was opened: its length, and the view to begin with.
void view_state_open_take(struct view_state *s, int64_t length_ns, int64_t frames, const struct orbit *orbit,
                          int64_t now_ns);
void view_state_fail(struct view_state *s, const char *sentence); // there is nothing to watch

void view_state_do(struct view_state *s, enum view_action action, int64_t now_ns);

// Fingers on the picture, in shares of its height. at: where the first finger lies on
// the floor before and after, metres; NULL where it points to no floor.
struct floor_drag {
    double from_x, from_y, to_x, to_y;
};
void view_state_gesture(struct view_state *s, const struct gesture *g, const struct floor_drag *at, int64_t now_ns);
void view_state_wheel(struct view_state *s, double notches, int64_t now_ns);

// The timeline is held at that share, or (held false) let go.
void view_state_scrub(struct view_state *s, bool held, double share, int64_t now_ns);
void view_state_set_speed(struct view_state *s, double speed, int64_t now_ns);
void view_state_set_error(struct view_state *s, double error_px);
void view_state_set_yaw(struct view_state *s, double yaw_rad);
void view_state_choose_take(struct view_state *s, int take);

void view_state_on_camera(struct view_state *s, const struct view_camera *camera, int64_t now_ns);
void view_state_set_problem(struct view_state *s, const char *sentence); // NULL: all is well again
void view_state_set_progress(struct view_state *s, double share);        // of the take's preparing
void view_state_set_avatar_shown(struct view_state *s, bool shown);      // the actor drawn last is the prepared one
void view_state_notify(struct view_state *s, const char *notice, int64_t now_ns);
void view_state_warn(struct view_state *s, const char *notice,
                     int64_t now_ns);                           // the same, of what went wrong; stays longer
void view_state_on_input(struct view_state *s, int64_t now_ns); // somebody touched the screen

// Time goes by. Returns until when nothing changes by itself: INT64_MAX, or now_ns while something moves.
int64_t view_state_tick(struct view_state *s, int64_t now_ns);

// Nobody looked from one time to the other.
void view_state_resume(struct view_state *s, int64_t from_ns, int64_t to_ns);

// One sentence on what is amiss or what to do; NULL when all is well.
const char *view_state_hint(const struct view_state *s);

// Are the controls shown? They go away while it plays and nobody touches.
bool view_state_controls_shown(const struct view_state *s);

// From where the take was filmed to where it is shown, without the mirror. anchor: the point he turns about.
struct pose placement_pose(const struct placement *p, struct vec3 pivot);
