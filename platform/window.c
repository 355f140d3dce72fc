#include "platform/window.h"

#include <SDL.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_PADS = 4 };

struct screen {
    SDL_Window *window;
    SDL_GLContext context;
    SDL_GameController *pads[MOST_PADS];
    Uint32 wake_event;
    SDL_atomic_t woken; // a wake event is under way
    int quarter_turns;
    double dpi_wished;
};

static enum status refused(struct screen **s, const char *what)
{
    enum status status = fail(ERR_DEVICE, "%s: %s", what, SDL_GetError());
    screen_close(s);
    return status;
}

static bool make_window(struct screen *s, const struct screen_options *o)
{
    SDL_SetHint(SDL_HINT_TOUCH_MOUSE_EVENTS, "0"); // a finger is a finger and no mouse besides
    SDL_SetHint(SDL_HINT_MOUSE_TOUCH_EVENTS, "0");
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_PROFILE_MASK, SDL_GL_CONTEXT_PROFILE_ES);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MAJOR_VERSION, 3);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MINOR_VERSION, 0);
    SDL_GL_SetAttribute(SDL_GL_DEPTH_SIZE, 0);
    Uint32 flags = SDL_WINDOW_OPENGL | SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI;
    if (o->fullscreen || !strcmp(SDL_GetCurrentVideoDriver(), "KMSDRM"))
        flags |= SDL_WINDOW_FULLSCREEN_DESKTOP;
    s->window = SDL_CreateWindow(o->title, SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED, o->width, o->height, flags);
    s->context = s->window ? SDL_GL_CreateContext(s->window) : NULL;
    return s->context;
}

enum status screen_open(struct screen **out, const struct screen_options *options)
{
    *out = NULL;
    struct screen *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for a window");
    s->quarter_turns = options->quarter_turns & 3;
    s->dpi_wished = options->dpi;
    SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");  // Ctrl-C is the program's
    SDL_SetHint(SDL_HINT_VIDEO_X11_FORCE_EGL, "1"); // ES 3 everywhere through EGL; without this, X11 tries GLX first
    if (SDL_Init(SDL_INIT_VIDEO))
        return refused(&s, "no window can be opened; is there a display?");
    if (!make_window(s, options))
        return refused(&s, "the display has no OpenGL ES 3; is its graphics driver, or Mesa's, installed?");
    SDL_GL_SetSwapInterval(1); // not every display can wait; then the loop's own pace holds
    // A tablet without a game pad is no fault.
    if (!SDL_InitSubSystem(SDL_INIT_GAMECONTROLLER))
        SDL_GameControllerEventState(SDL_ENABLE);
    s->wake_event = SDL_RegisterEvents(1);
    *out = s;
    return OK;
}

void screen_close(struct screen **out)
{
    struct screen *s = *out;
    if (!s)
        return;
    for (int i = 0; i < MOST_PADS; i++)
        if (s->pads[i])
            SDL_GameControllerClose(s->pads[i]);
    if (s->context)
        SDL_GL_DeleteContext(s->context);
    if (s->window)
        SDL_DestroyWindow(s->window);
    SDL_Quit();
    free(s);
    *out = NULL;
}

void screen_size(const struct screen *s, int *width, int *height)
{
    int w, h;
    SDL_GL_GetDrawableSize(s->window, &w, &h);
    *width = s->quarter_turns & 1 ? h : w;
    *height = s->quarter_turns & 1 ? w : h;
}

// What the panel says of itself (EDID, bytes 21 and 22: centimetres), for KMS, where SDL does not ask. 0: nobody says.
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

double screen_dpi(const struct screen *s)
{
    if (s->dpi_wished > 0)
        return s->dpi_wished;
    float dpi = 0;
    int display = SDL_GetWindowDisplayIndex(s->window), width, height;
    SDL_GL_GetDrawableSize(s->window, &width, &height);
    if (!strcmp(screen_driver(s), "KMSDRM"))
        dpi = (float)panel_dpi(width);
    else if (SDL_GetDisplayDPI(display < 0 ? 0 : display, NULL, &dpi, NULL))
        dpi = 0;
    return dpi >= 60 && dpi <= 800 ? (double)dpi : 96; // others are made up
}

double screen_refresh_hz(const struct screen *s)
{
    SDL_DisplayMode mode;
    int display = SDL_GetWindowDisplayIndex(s->window);
    if (SDL_GetCurrentDisplayMode(display < 0 ? 0 : display, &mode) || mode.refresh_rate < 20)
        return 60;
    return mode.refresh_rate;
}

int screen_quarter_turns(const struct screen *s) { return s->quarter_turns; }

const char *screen_driver(const struct screen *s)
{
    (void)s;
    return SDL_GetCurrentVideoDriver();
}

void screen_show(struct screen *s) { SDL_GL_SwapWindow(s->window); }

void screen_fullscreen(struct screen *s, bool on)
{
    SDL_SetWindowFullscreen(s->window, on ? SDL_WINDOW_FULLSCREEN_DESKTOP : 0);
}

// ---------------------------------------------------------------- hands

// From shares of the glass to upright pixels.
static void upright(const struct screen *s, double right, double down, struct screen_event *out)
{
    int width, height;
    screen_size(s, &width, &height);
    double x = right, y = down;
    switch (s->quarter_turns) {
    case 1: x = down, y = 1 - right; break;
    case 2: x = 1 - right, y = 1 - down; break;
    case 3: x = 1 - down, y = right; break;
    default: break;
    }
    out->x = x * width;
    out->y = y * height;
}

static void hear_mouse(const struct screen *s, int x, int y, enum screen_event_kind kind, struct screen_event *out)
{
    int width, height; // of the window in its own units, which are not pixels everywhere
    SDL_GetWindowSize(s->window, &width, &height);
    out->kind = kind;
    out->pointer = -1;
    upright(s, (x + 0.5) / width, (y + 0.5) / height, out);
}

static void hear_finger(const struct screen *s, const SDL_TouchFingerEvent *e, enum screen_event_kind kind,
                        struct screen_event *out)
{
    out->kind = kind;
    out->pointer = e->fingerId & 0x7fffffff;
    upright(s, (double)e->x, (double)e->y, out);
}

static void hear_key(const SDL_KeyboardEvent *e, struct screen_event *out)
{
    static const struct {
        SDL_Keycode from;
        int to;
    } keys[] = {
        {SDLK_LEFT, SCREEN_KEY_LEFT}, {SDLK_RIGHT, SCREEN_KEY_RIGHT},  {SDLK_UP, SCREEN_KEY_UP},
        {SDLK_DOWN, SCREEN_KEY_DOWN}, {SDLK_HOME, SCREEN_KEY_HOME},    {SDLK_END, SCREEN_KEY_END},
        {SDLK_F11, SCREEN_KEY_F11},   {SDLK_AC_BACK, SCREEN_KEY_BACK},
    };
    out->shift = e->keysym.mod & KMOD_SHIFT;
    out->key = e->keysym.sym > 0 && e->keysym.sym < 128 ? e->keysym.sym : 0;
    for (size_t i = 0; i < COUNT_OF(keys); i++)
        if (keys[i].from == e->keysym.sym)
            out->key = keys[i].to;
    out->kind = out->key ? SCREEN_KEY : SCREEN_NOTHING;
}

static void hear_window(const SDL_WindowEvent *e, struct screen_event *out)
{
    switch (e->event) {
    case SDL_WINDOWEVENT_SIZE_CHANGED:
    case SDL_WINDOWEVENT_EXPOSED:
    case SDL_WINDOWEVENT_DISPLAY_CHANGED: out->kind = SCREEN_RESIZED; break;
    case SDL_WINDOWEVENT_HIDDEN:
    case SDL_WINDOWEVENT_MINIMIZED: out->kind = SCREEN_HIDDEN; break;
    case SDL_WINDOWEVENT_SHOWN:
    case SDL_WINDOWEVENT_RESTORED: out->kind = SCREEN_SHOWN; break;
    default: break;
    }
}

static void plug_pad(struct screen *s, int device)
{
    for (int i = 0; i < MOST_PADS; i++)
        if (!s->pads[i]) {
            s->pads[i] = SDL_GameControllerOpen(device);
            return;
        }
}

static void unplug_pad(struct screen *s, SDL_JoystickID which)
{
    for (int i = 0; i < MOST_PADS; i++)
        if (s->pads[i] && SDL_JoystickInstanceID(SDL_GameControllerGetJoystick(s->pads[i])) == which) {
            SDL_GameControllerClose(s->pads[i]);
            s->pads[i] = NULL;
        }
}

static void hear_pad(const SDL_Event *e, struct screen_event *out)
{
    static const enum screen_button buttons[] = {
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
        out->kind = SCREEN_PAD_BUTTON;
        out->button = buttons[e->cbutton.button];
    } else if (e->caxis.axis < PAD_AXES) { // in the order of enum screen_axis
        const double rest = 0.15, raw = e->caxis.value / 32767.0;
        out->kind = SCREEN_PAD_AXIS;
        out->axis = (enum screen_axis)e->caxis.axis;
        out->amount = raw > rest ? (raw - rest) / (1 - rest) : raw < -rest ? (raw + rest) / (1 - rest) : 0;
    }
}

static void hear(struct screen *s, const SDL_Event *e, struct screen_event *out)
{
    if (e->type == s->wake_event) {
        SDL_AtomicSet(&s->woken, 0);
        out->kind = SCREEN_WOKEN;
        return;
    }
    switch (e->type) {
    case SDL_QUIT: out->kind = SCREEN_QUIT; break;
    case SDL_KEYDOWN: hear_key(&e->key, out); break;
    case SDL_WINDOWEVENT: hear_window(&e->window, out); break;
    case SDL_APP_WILLENTERBACKGROUND: out->kind = SCREEN_HIDDEN; break;
    case SDL_APP_DIDENTERFOREGROUND: out->kind = SCREEN_SHOWN; break;
    case SDL_RENDER_TARGETS_RESET: out->kind = SCREEN_RESIZED; break;
    case SDL_MOUSEBUTTONDOWN:
    case SDL_MOUSEBUTTONUP:
        if (e->button.button == SDL_BUTTON_LEFT)
            hear_mouse(s, e->button.x, e->button.y,
                       e->type == SDL_MOUSEBUTTONDOWN ? SCREEN_POINTER_DOWN : SCREEN_POINTER_UP, out);
        break;
    case SDL_MOUSEMOTION: hear_mouse(s, e->motion.x, e->motion.y, SCREEN_POINTER_MOVE, out); break;
    case SDL_FINGERDOWN: hear_finger(s, &e->tfinger, SCREEN_POINTER_DOWN, out); break;
    case SDL_FINGERMOTION: hear_finger(s, &e->tfinger, SCREEN_POINTER_MOVE, out); break;
    case SDL_FINGERUP: hear_finger(s, &e->tfinger, SCREEN_POINTER_UP, out); break;
    case SDL_MOUSEWHEEL:
        out->kind = SCREEN_WHEEL;
        out->amount = (double)e->wheel.preciseY;
        break;
    case SDL_CONTROLLERDEVICEADDED: plug_pad(s, e->cdevice.which); break;
    case SDL_CONTROLLERDEVICEREMOVED: unplug_pad(s, e->cdevice.which); break;
    case SDL_CONTROLLERBUTTONDOWN:
    case SDL_CONTROLLERAXISMOTION: hear_pad(e, out); break;
    default: break;
    }
}

struct screen_event screen_wait(struct screen *s, int wait_ms)
{
    struct screen_event out = {.kind = SCREEN_NOTHING};
    SDL_Event event;
    if (wait_ms > 0 ? SDL_WaitEventTimeout(&event, wait_ms) : SDL_PollEvent(&event))
        do
            hear(s, &event, &out);
        while (out.kind == SCREEN_NOTHING && SDL_PollEvent(&event)); // what means nothing to us is passed over
    return out;
}

void screen_wake(struct screen *s)
{
    if (!SDL_AtomicCAS(&s->woken, 0, 1))
        return; // one is enough
    SDL_Event event = {.type = s->wake_event};
    SDL_PushEvent(&event);
}
