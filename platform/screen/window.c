#include "platform/screen/window.h"

#include "base/threads.h"

#include <SDL.h>
#include <SDL_syswm.h>
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MAX_PADS = 4 };
enum { LEAVE_MS = 1000 }; // left to a program whose display is gone, by hand

struct window {
    SDL_Window *window;
    SDL_GLContext context;
    SDL_GameController *pads[MAX_PADS];
    Uint32 wake_event;
    SDL_atomic_t woken; // 1: a wake event is in the queue
    int quarter_turns;
    double requested_dpi;
    char *dropped;   // SDL's; NULL: none
    bool types;      // text is typed (window_type)
    bool other_text; // what comes next as text is of a key that was pressed before it was
    struct worker_thread watch;
    int display;    // the X server's socket, which is SDL's; watched for its end
    int closing[2]; // a pipe: its second end is closed to end the watch. 0: no watch
};

static enum status fail_open(struct window **window, const char *what, const char *why)
{
    enum status status = *why ? fail(ERR_DEVICE, "%s (SDL: %s)", what, why) : fail(ERR_DEVICE, "%s", what);
    window_close(window);
    return status;
}

// ---------------------------------------------------------------- a display that is gone

static int poll_for(struct pollfd *ends, nfds_t count, int wait_ms)
{
    int ready;
    while ((ready = poll(ends, count, wait_ms)) < 0 && errno == EINTR)
        ;
    return ready;
}

// Xlib ends the program when the X server is gone, but only once it reads from it. Where the end comes while the
// processor draws, Mesa 22.3 notices first, and divides its picture into pieces of a negative height for ever:
// xcb_get_maximum_request_length is 0 then (swrastPutImage, src/egl/drivers/dri2/platform_x11.c). Exit handlers could
// hang as well, so they are not run again.
static void *watch_display(void *self)
{
    const struct window *window = self;
    struct pollfd ends[] = {{window->display, POLLRDHUP, 0}, {window->closing[0], 0, 0}};
    if (poll_for(ends, 2, -1) > 0 && !ends[1].revents && poll_for(ends + 1, 1, LEAVE_MS) == 0) {
        (void)dprintf(STDERR_FILENO, "the display is gone\n");
        _exit(EXIT_FAILURE);
    }
    return NULL;
}

static enum status start_watch(struct window *window)
{
#ifdef SDL_VIDEO_DRIVER_X11
    SDL_SysWMinfo system;
    SDL_VERSION(&system.version);
    if (!SDL_GetWindowWMInfo(window->window, &system) || system.subsystem != SDL_SYSWM_X11)
        return OK;
    window->display = ConnectionNumber(system.info.x11.display);
    if (pipe2(window->closing, O_CLOEXEC)) {
        window->closing[0] = window->closing[1] = 0;
        return fail(ERR_IO, "no pipe to watch the display with: %s", strerror(errno));
    }
    worker_thread_open(&window->watch);
    return worker_thread_start(&window->watch, watch_display, window, "to watch the display");
#else
    (void)window;
    return OK;
#endif
}

static void end_watch(struct window *window)
{
    if (!window->closing[1])
        return;
    close(window->closing[1]);
    worker_thread_close(&window->watch);
    close(window->closing[0]);
}

// ---------------------------------------------------------------- open and close

static const char NO_DISPLAY[] =
    "there is no display to show a window on: start it in a desktop, or on a console of its own without one";

static bool make_window(struct window *window, const struct window_options *options)
{
    SDL_SetHint(SDL_HINT_TOUCH_MOUSE_EVENTS, "0"); // no mouse events for touches, nor the reverse
    SDL_SetHint(SDL_HINT_MOUSE_TOUCH_EVENTS, "0");
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_PROFILE_MASK, SDL_GL_CONTEXT_PROFILE_ES);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MAJOR_VERSION, 3);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MINOR_VERSION, 0);
    SDL_GL_SetAttribute(SDL_GL_DEPTH_SIZE, 0);
    Uint32 flags = SDL_WINDOW_OPENGL | SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI;
    if (options->fullscreen || !strcmp(SDL_GetCurrentVideoDriver(), "KMSDRM"))
        flags |= SDL_WINDOW_FULLSCREEN_DESKTOP;
    SDL_Rect room; // what is larger than the screen would have its edges, and what is to be touched there, beside it
    const bool known = !SDL_GetDisplayUsableBounds(0, &room) && room.w > 0 && room.h > 0;
    window->window = SDL_CreateWindow(options->title, SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                                      known ? SDL_min(options->width, room.w) : options->width,
                                      known ? SDL_min(options->height, room.h) : options->height, flags);
    window->context = window->window ? SDL_GL_CreateContext(window->window) : NULL;
    return window->context;
}

// Wayland's library writes a line of its own to stderr where the folder of its sockets has no name.
static bool start_video(void)
{
    const bool nameless = !getenv("XDG_RUNTIME_DIR");
    if (nameless)
        setenv("XDG_RUNTIME_DIR", "/nonexistent", 0);
    const bool good = !SDL_Init(SDL_INIT_VIDEO);
    if (nameless)
        unsetenv("XDG_RUNTIME_DIR");
    return good;
}

enum status window_open(struct window **out, const struct window_options *options)
{
    *out = NULL;
    struct window *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for a window");
    s->quarter_turns = options->quarter_turns & 3;
    s->requested_dpi = options->dpi;
    SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");  // the program handles SIGINT itself
    SDL_SetHint(SDL_HINT_VIDEO_X11_FORCE_EGL, "1"); // ES 3 everywhere through EGL; without this, X11 tries GLX first
    if (!start_video())
        return fail_open(&s, NO_DISPLAY, getenv("SDL_VIDEODRIVER") ? SDL_GetError() : "");
    // SDL falls back to drawing where nothing is seen; only who asks for that gets it.
    if (!getenv("SDL_VIDEODRIVER") &&
        (!strcmp(SDL_GetCurrentVideoDriver(), "offscreen") || !strcmp(SDL_GetCurrentVideoDriver(), "dummy") ||
         !strcmp(SDL_GetCurrentVideoDriver(), "evdev")))
        return fail_open(&s, NO_DISPLAY, "");
    if (!make_window(s, options))
        return fail_open(&s, "the display has no OpenGL ES 3; is its graphics driver, or Mesa's, installed?",
                         SDL_GetError());
    const enum status watched = start_watch(s);
    if (watched != OK) {
        window_close(&s);
        return watched;
    }
    // Text always comes, so that what is typed fast is not lost, but where it would bring up a keyboard on the screen.
    if (SDL_HasScreenKeyboardSupport())
        SDL_StopTextInput();
    else
        SDL_StartTextInput();
    SDL_GL_SetSwapInterval(1); // may fail: then the main loop's own pacing limits the rate
    // Game pads are optional.
    if (!SDL_InitSubSystem(SDL_INIT_GAMECONTROLLER))
        SDL_GameControllerEventState(SDL_ENABLE);
    if (!strcmp(SDL_GetCurrentVideoDriver(), "x11"))
        SDL_EventState(SDL_SYSWMEVENT, SDL_ENABLE);
    s->wake_event = SDL_RegisterEvents(1);
    *out = s;
    return OK;
}

void window_close(struct window **out)
{
    struct window *window = *out;
    if (!window)
        return;
    end_watch(window);
    for (int i = 0; i < MAX_PADS; i++)
        if (window->pads[i])
            SDL_GameControllerClose(window->pads[i]);
    SDL_free(window->dropped);
    if (window->context)
        SDL_GL_DeleteContext(window->context);
    if (window->window)
        SDL_DestroyWindow(window->window);
    SDL_Quit();
    free(window);
    *out = NULL;
}

void window_size(const struct window *window, int *width, int *height)
{
    int w, h;
    SDL_GL_GetDrawableSize(window->window, &w, &h);
    *width = window->quarter_turns & 1 ? h : w;
    *height = window->quarter_turns & 1 ? w : h;
}

// From the panel's EDID (byte 21: width in centimetres), for KMS, where SDL does not read it. 0: unknown.
static double panel_dpi(int width_px)
{
    glob_t found;
    double dpi = 0;
    if (glob("/sys/class/drm/card*-*/edid", 0, NULL, &found))
        return 0;
    for (size_t i = 0; i < found.gl_pathc && dpi <= 0; i++) {
        unsigned char edid[128];
        FILE *file = fopen(found.gl_pathv[i], "rb");
        if (file && fread(edid, 1, sizeof edid, file) == sizeof edid && edid[21] > 0)
            dpi = width_px / (edid[21] / 2.54);
        if (file)
            fclose(file);
    }
    globfree(&found);
    return dpi;
}

double window_dpi(const struct window *window)
{
    if (window->requested_dpi > 0)
        return window->requested_dpi;
    float dpi = 0;
    int display = SDL_GetWindowDisplayIndex(window->window), width, height;
    SDL_GL_GetDrawableSize(window->window, &width, &height);
    if (!strcmp(window_driver(window), "KMSDRM"))
        dpi = (float)panel_dpi(width);
    else if (SDL_GetDisplayDPI(display < 0 ? 0 : display, NULL, &dpi, NULL))
        dpi = 0;
    return dpi >= 60 && dpi <= 800 ? (double)dpi : 96; // values outside are placeholders
}

double window_refresh_hz(const struct window *window)
{
    SDL_DisplayMode mode;
    int display = SDL_GetWindowDisplayIndex(window->window);
    if (SDL_GetCurrentDisplayMode(display < 0 ? 0 : display, &mode) || mode.refresh_rate < 20)
        return 60;
    return mode.refresh_rate;
}

int window_quarter_turns(const struct window *window) { return window->quarter_turns; }

const char *window_driver(const struct window *window)
{
    (void)window;
    return SDL_GetCurrentVideoDriver();
}

void window_present(struct window *window) { SDL_GL_SwapWindow(window->window); }

void window_fullscreen(struct window *window, bool on)
{
    SDL_SetWindowFullscreen(window->window, on ? SDL_WINDOW_FULLSCREEN_DESKTOP : 0);
}

// ---------------------------------------------------------------- input

// From a position on the display as mounted, 0..1 per axis, to upright pixels.
static void to_upright(const struct window *window, double right, double down, struct window_event *out)
{
    int width, height;
    window_size(window, &width, &height);
    double x = right, y = down;
    switch (window->quarter_turns) {
    case 1: x = down, y = 1 - right; break;
    case 2: x = 1 - right, y = 1 - down; break;
    case 3: x = 1 - down, y = right; break;
    default: break;
    }
    out->x = x * width;
    out->y = y * height;
}

static void translate_mouse(const struct window *window, int x, int y, enum window_event_kind kind,
                            struct window_event *out)
{
    int width, height; // in window units, which are not pixels everywhere
    SDL_GetWindowSize(window->window, &width, &height);
    out->kind = kind;
    out->pointer = -1;
    to_upright(window, (x + 0.5) / width, (y + 0.5) / height, out);
}

static void translate_finger(const struct window *window, const SDL_TouchFingerEvent *e, enum window_event_kind kind,
                             struct window_event *out)
{
    out->kind = kind;
    out->pointer = e->fingerId & 0x7fffffff;
    to_upright(window, (double)e->x, (double)e->y, out);
}

static void translate_key(const SDL_KeyboardEvent *e, struct window_event *out)
{
    static const struct {
        SDL_Keycode from;
        int to;
    } keys[] = {
        {SDLK_LEFT, WINDOW_KEY_LEFT}, {SDLK_RIGHT, WINDOW_KEY_RIGHT},  {SDLK_UP, WINDOW_KEY_UP},
        {SDLK_DOWN, WINDOW_KEY_DOWN}, {SDLK_HOME, WINDOW_KEY_HOME},    {SDLK_END, WINDOW_KEY_END},
        {SDLK_F11, WINDOW_KEY_F11},   {SDLK_AC_BACK, WINDOW_KEY_BACK},
    };
    out->shift = e->keysym.mod & KMOD_SHIFT;
    out->repeat = e->repeat;
    out->key = e->keysym.sym > 0 && e->keysym.sym < 128 ? e->keysym.sym : 0;
    for (size_t i = 0; i < COUNT_OF(keys); i++)
        if (keys[i].from == e->keysym.sym)
            out->key = keys[i].to;
    out->kind = e->type == SDL_KEYUP ? WINDOW_KEY_RELEASED : WINDOW_KEY;
    if (!out->key)
        out->kind = WINDOW_NO_EVENT;
}

static void translate_window(const SDL_WindowEvent *e, struct window_event *out)
{
    switch (e->event) {
    case SDL_WINDOWEVENT_SIZE_CHANGED:
    case SDL_WINDOWEVENT_EXPOSED:
    case SDL_WINDOWEVENT_DISPLAY_CHANGED: out->kind = WINDOW_RESIZED; break;
    case SDL_WINDOWEVENT_HIDDEN:
    case SDL_WINDOWEVENT_MINIMIZED: out->kind = WINDOW_HIDDEN; break;
    case SDL_WINDOWEVENT_SHOWN:
    case SDL_WINDOWEVENT_RESTORED: out->kind = WINDOW_SHOWN; break;
    case SDL_WINDOWEVENT_FOCUS_LOST: out->kind = WINDOW_UNFOCUSED; break;
    case SDL_WINDOWEVENT_FOCUS_GAINED: out->kind = WINDOW_FOCUSED; break;
    default: break;
    }
}

// SDL says a fifth of a second later that the focus was lost, and nothing where another program grabs the keyboard, as
// one that locks the screen does; the X server says both.
static void translate_system(const SDL_SysWMEvent *e, struct window_event *out)
{
#ifdef SDL_VIDEO_DRIVER_X11
    if (!e->msg || e->msg->subsystem != SDL_SYSWM_X11 || e->msg->msg.x11.event.type != FocusOut)
        return;
    const XFocusChangeEvent *focus = &e->msg->msg.x11.event.xfocus;
    if (focus->detail != NotifyInferior && focus->detail != NotifyPointer)
        out->kind = WINDOW_UNFOCUSED;
#else
    (void)e;
    (void)out;
#endif
}

static void plug_pad(struct window *window, int device)
{
    for (int i = 0; i < MAX_PADS; i++)
        if (!window->pads[i]) {
            window->pads[i] = SDL_GameControllerOpen(device);
            return;
        }
}

static void unplug_pad(struct window *window, SDL_JoystickID which)
{
    for (int i = 0; i < MAX_PADS; i++)
        if (window->pads[i] && SDL_JoystickInstanceID(SDL_GameControllerGetJoystick(window->pads[i])) == which) {
            SDL_GameControllerClose(window->pads[i]);
            window->pads[i] = NULL;
        }
}

// A stick's or trigger's deflection, from the edge of its dead zone on.
static double axis_amount(double raw)
{
    const double dead_zone = 0.15;
    if (raw > dead_zone)
        return (raw - dead_zone) / (1 - dead_zone);
    return raw < -dead_zone ? (raw + dead_zone) / (1 - dead_zone) : 0;
}

static void translate_pad(const SDL_Event *e, struct window_event *out)
{
    static const enum pad_button buttons[] = {
        [SDL_CONTROLLER_BUTTON_A] = PAD_A,
        [SDL_CONTROLLER_BUTTON_B] = PAD_B,
        [SDL_CONTROLLER_BUTTON_X] = PAD_X,
        [SDL_CONTROLLER_BUTTON_Y] = PAD_Y,
        [SDL_CONTROLLER_BUTTON_BACK] = PAD_BACK,
        [SDL_CONTROLLER_BUTTON_GUIDE] = PAD_BUTTONS,
        [SDL_CONTROLLER_BUTTON_START] = PAD_START,
        [SDL_CONTROLLER_BUTTON_LEFTSTICK] = PAD_BUTTONS,
        [SDL_CONTROLLER_BUTTON_RIGHTSTICK] = PAD_BUTTONS,
        [SDL_CONTROLLER_BUTTON_LEFTSHOULDER] = PAD_LEFT_SHOULDER,
        [SDL_CONTROLLER_BUTTON_RIGHTSHOULDER] = PAD_RIGHT_SHOULDER,
        [SDL_CONTROLLER_BUTTON_DPAD_UP] = PAD_UP,
        [SDL_CONTROLLER_BUTTON_DPAD_DOWN] = PAD_DOWN,
        [SDL_CONTROLLER_BUTTON_DPAD_LEFT] = PAD_LEFT,
        [SDL_CONTROLLER_BUTTON_DPAD_RIGHT] = PAD_RIGHT,
    };
    if (e->type == SDL_CONTROLLERBUTTONDOWN) {
        if (e->cbutton.button >= COUNT_OF(buttons) || buttons[e->cbutton.button] == PAD_BUTTONS)
            return;
        out->kind = WINDOW_PAD_BUTTON;
        out->button = buttons[e->cbutton.button];
    } else if (e->caxis.axis < PAD_AXES) { // in the order of enum pad_axis
        out->kind = WINDOW_PAD_AXIS;
        out->axis = (enum pad_axis)e->caxis.axis;
        out->amount = axis_amount(e->caxis.value / 32767.0);
    }
}

static void translate_event(struct window *window, const SDL_Event *e, struct window_event *out)
{
    if (e->type == window->wake_event) {
        SDL_AtomicSet(&window->woken, 0);
        out->kind = WINDOW_WOKEN;
        return;
    }
    switch (e->type) {
    case SDL_QUIT: out->kind = WINDOW_QUIT; break;
    case SDL_KEYDOWN:
        window->other_text = !window->types;
        translate_key(&e->key, out);
        break;
    case SDL_KEYUP:
        window->other_text = false;
        translate_key(&e->key, out);
        break;
    case SDL_TEXTINPUT:
        out->kind = window->types && !window->other_text ? WINDOW_TEXT : WINDOW_NO_EVENT;
        snprintf(out->text, sizeof out->text, "%s", e->text.text);
        window->other_text = false;
        break;
    case SDL_DROPFILE:
        SDL_free(window->dropped);
        window->dropped = e->drop.file;
        out->kind = WINDOW_DROPPED;
        break;
    case SDL_WINDOWEVENT: translate_window(&e->window, out); break;
    case SDL_SYSWMEVENT: translate_system(&e->syswm, out); break;
    case SDL_APP_WILLENTERBACKGROUND: out->kind = WINDOW_HIDDEN; break;
    case SDL_APP_DIDENTERFOREGROUND: out->kind = WINDOW_SHOWN; break;
    case SDL_RENDER_TARGETS_RESET: out->kind = WINDOW_RESIZED; break;
    case SDL_MOUSEBUTTONDOWN:
    case SDL_MOUSEBUTTONUP:
        if (e->button.button == SDL_BUTTON_LEFT)
            translate_mouse(window, e->button.x, e->button.y,
                            e->type == SDL_MOUSEBUTTONDOWN ? WINDOW_POINTER_DOWN : WINDOW_POINTER_UP, out);
        break;
    case SDL_MOUSEMOTION: translate_mouse(window, e->motion.x, e->motion.y, WINDOW_POINTER_MOVE, out); break;
    case SDL_FINGERDOWN: translate_finger(window, &e->tfinger, WINDOW_POINTER_DOWN, out); break;
    case SDL_FINGERMOTION: translate_finger(window, &e->tfinger, WINDOW_POINTER_MOVE, out); break;
    case SDL_FINGERUP: translate_finger(window, &e->tfinger, WINDOW_POINTER_UP, out); break;
    case SDL_MOUSEWHEEL:
        out->kind = WINDOW_WHEEL;
        out->amount = (double)e->wheel.preciseY;
        break;
    case SDL_CONTROLLERDEVICEADDED: plug_pad(window, e->cdevice.which); break;
    case SDL_CONTROLLERDEVICEREMOVED:
        unplug_pad(window, e->cdevice.which);
        out->kind = WINDOW_PAD_GONE;
        break;
    case SDL_CONTROLLERBUTTONDOWN:
    case SDL_CONTROLLERAXISMOTION: translate_pad(e, out); break;
    default: break;
    }
}

struct window_event window_wait(struct window *window, int wait_ms)
{
    struct window_event out = {.kind = WINDOW_NO_EVENT};
    SDL_Event event;
    if (wait_ms > 0 ? SDL_WaitEventTimeout(&event, wait_ms) : SDL_PollEvent(&event))
        do
            translate_event(window, &event, &out);
        while (out.kind == WINDOW_NO_EVENT && SDL_PollEvent(&event)); // events that are not translated are skipped
    return out;
}

void window_drop_input(struct window *window)
{
    static const struct {
        Uint32 first, last;
    } kinds[] = {{SDL_KEYDOWN, SDL_KEYDOWN},
                 {SDL_TEXTEDITING, SDL_TEXTINPUT},
                 {SDL_MOUSEBUTTONDOWN, SDL_MOUSEWHEEL},
                 {SDL_CONTROLLERBUTTONDOWN, SDL_CONTROLLERBUTTONDOWN},
                 {SDL_FINGERDOWN, SDL_FINGERUP}};
    (void)window; // SDL has one queue
    SDL_PumpEvents();
    for (size_t i = 0; i < COUNT_OF(kinds); i++)
        SDL_FlushEvents(kinds[i].first, kinds[i].last);
}

const char *window_dropped_file(const struct window *window) { return window->dropped ? window->dropped : ""; }

void window_say(const char *title, const char *sentence)
{
    SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
    (void)SDL_ShowSimpleMessageBox(SDL_MESSAGEBOX_ERROR, title, sentence, NULL);
}

void window_type(struct window *window, bool on)
{
    if (on == window->types)
        return;
    window->types = on;
    if (on && !SDL_IsTextInputActive())
        SDL_StartTextInput();
    else if (!on && SDL_HasScreenKeyboardSupport())
        SDL_StopTextInput();
}

void window_wake(struct window *window)
{
    if (!SDL_AtomicCAS(&window->woken, 0, 1))
        return; // one is queued already
    SDL_Event event = {.type = window->wake_event};
    if (SDL_PushEvent(&event) != 1) // the queue is full: what is in it wakes, and the next call tries again
        SDL_AtomicSet(&window->woken, 0);
}
