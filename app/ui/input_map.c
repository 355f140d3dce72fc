#include "app/ui/input_map.h"

#include "base/text.h"

static const double TAP_DP = 16; // a tap moves no farther; chosen by hand

enum view_action input_map_key(int key, bool shift)
{
    switch (key) {
    case WINDOW_KEY_SPACE: return DO_PLAY_PAUSE;
    case WINDOW_KEY_ENTER: return DO_CHOOSE;
    case WINDOW_KEY_LEFT: return shift ? DO_TO_START : DO_STEP_BACK;
    case WINDOW_KEY_RIGHT: return shift ? DO_TO_END : DO_STEP_ON;
    case WINDOW_KEY_UP: return DO_PREVIOUS;
    case WINDOW_KEY_DOWN: return DO_NEXT;
    case WINDOW_KEY_HOME: return DO_TO_START;
    case WINDOW_KEY_END: return DO_TO_END;
    case WINDOW_KEY_ESCAPE:
    case WINDOW_KEY_BACK: return DO_BACK;
    case WINDOW_KEY_F11:
    case 'f': return DO_FULLSCREEN;
    case '-':
    case '[': return DO_SLOWER;
    case '+':
    case '=':
    case ']': return DO_FASTER;
    case 'l': return DO_LOOP;
    case 'm': return DO_MIRROR;
    case 'o': return DO_ORBIT;
    case '1': return DO_SEE_FRONT;
    case '2': return DO_SEE_SIDE;
    case '3': return DO_SEE_BACK;
    case '4': return DO_SEE_ABOVE;
    case '0': return DO_SEE_START;
    case '5': return (enum view_action)(DO_TOLERANCE + GROUP_HEAD);
    case '6': return (enum view_action)(DO_TOLERANCE + GROUP_TRUNK);
    case '7': return (enum view_action)(DO_TOLERANCE + GROUP_ARMS);
    case '8': return (enum view_action)(DO_TOLERANCE + GROUP_LEGS);
    case '9': return DO_COUNT_MARKED;
    case 'b': return DO_SKELETON;
    case 'x': return DO_SOURCES;
    case 'i': return DO_INSET;
    case 't': return DO_FRAME_GRAPH;
    case 'd': return DO_THEME;
    case 'y': return DO_TEXT_SIZE;
    case 'g': return DO_MOVE;
    case 'r': return DO_RESET_PLACEMENT;
    case 'p': return DO_SCREENSHOT;
    case 'q': return DO_QUIT;
    case 'v': return DO_SCREEN;
    case 'k': return DO_PACE;
    case 'h': return DO_OVER;
    case 'n': return DO_GHOST;
    case 'a': return DO_HANDS_FREE;
    case ',': return DO_MARK_FROM;
    case '.': return DO_MARK_TO;
    case 's': return DO_KEEP;
    case 'e': return DO_NAMES;
    case 'c': return DO_MAP;
    case 'z': return DO_FILMED;
    case 'w': return DO_THINGS;
    default: return DO_NOTHING;
    }
}

enum view_action input_map_button(enum pad_button button)
{
    static const enum view_action actions[PAD_BUTTONS] = {
        [PAD_A] = DO_CHOOSE,
        [PAD_B] = DO_BACK,
        [PAD_X] = DO_SCREENSHOT,
        [PAD_Y] = DO_MOVE,
        [PAD_BACK] = DO_TAKES,
        [PAD_START] = DO_PLAY_PAUSE,
        [PAD_LEFT_SHOULDER] = DO_SLOWER,
        [PAD_RIGHT_SHOULDER] = DO_FASTER,
        [PAD_UP] = DO_ORBIT,
        [PAD_DOWN] = DO_SKELETON,
        [PAD_LEFT] = DO_STEP_BACK,
        [PAD_RIGHT] = DO_STEP_ON,
    };
    return button < PAD_BUTTONS ? actions[button] : DO_NOTHING;
}

static void set_pointer(struct input_map *map, const struct window_event *event, double px_per_dp)
{
    map->pointer_x = event->x / px_per_dp;
    map->pointer_y = event->y / px_per_dp;
    map->pointer_there = true;
    map->leaving = false;
}

static bool on_pointer(struct input_map *map, struct view_state *state, const struct window_event *event,
                       double px_per_dp, int64_t now_ns)
{
    const double x = event->x / px_per_dp, y = event->y / px_per_dp;
    const bool first = map->pointer_down && map->pointer == event->pointer, mouse = event->pointer < 0;
    switch (event->kind) {
    case WINDOW_POINTER_DOWN:
        gesture_down(&map->gesture, event->pointer, x, y, now_ns);
        if (map->pointer_down)
            return false;
        set_pointer(map, event, px_per_dp);
        map->pointer_down = true;
        map->pointer = event->pointer;
        break;
    case WINDOW_POINTER_UP:
        gesture_up(&map->gesture, event->pointer, TAP_DP, now_ns);
        if (!first)
            return false;
        set_pointer(map, event, px_per_dp);
        map->pointer_down = false;
        map->leaving = !mouse;
        break;
    default:
        gesture_move(&map->gesture, event->pointer, x, y);
        if (first || (mouse && !map->pointer_down))
            set_pointer(map, event, px_per_dp);
        state->changed = true;
        return false;
    }
    state->changed = true;
    return true;
}

// While a thing is looked for by its name, letters are letters.
static void on_key(struct view_state *state, const struct window_event *event, int64_t now_ns)
{
    const bool finding = view_state_types(state), letter = event->key >= 32 && event->key < 127;
    state->changed |= finding;
    if (finding && event->key == WINDOW_KEY_ENTER)
        state->room.enter = true;
    else if (finding && event->key == WINDOW_KEY_BACKSPACE)
        text_remove_last(state->room.filter);
    else if (!finding || !letter) // letters come as text
        view_state_do(state, input_map_key(event->key, event->shift), now_ns);
}

bool input_map_is_meant(const struct input_map *map, int page, const struct window_event *event)
{
    const bool presses = event->kind == WINDOW_POINTER_DOWN || event->kind == WINDOW_POINTER_UP ||
                         event->kind == WINDOW_WHEEL || event->kind == WINDOW_KEY || event->kind == WINDOW_TEXT ||
                         event->kind == WINDOW_PAD_BUTTON;
    return !presses || (map->shows && map->shown_page == page);
}

void input_map_forget(struct input_map *map)
{
    map->pointer_down = map->pointer_there = map->leaving = false;
    map->gesture = (struct gesture){0};
}

bool input_map_event(struct input_map *map, struct view_state *state, const struct window_event *event,
                     double px_per_dp, int64_t now_ns)
{
    switch (event->kind) {
    case WINDOW_POINTER_DOWN:
    case WINDOW_POINTER_MOVE:
    case WINDOW_POINTER_UP: return on_pointer(map, state, event, px_per_dp, now_ns);
    case WINDOW_WHEEL:
        map->wheel += event->amount;
        state->changed = true;
        break;
    case WINDOW_KEY: on_key(state, event, now_ns); break;
    case WINDOW_TEXT: state->changed |= view_state_types(state) && room_state_type(&state->room, event->text); break;
    case WINDOW_PAD_BUTTON: view_state_do(state, input_map_button(event->button), now_ns); break;
    case WINDOW_PAD_AXIS: map->pad[event->axis] = event->amount; break;
    case WINDOW_RESIZED: state->changed = true; break;
    case WINDOW_QUIT: view_state_do(state, DO_QUIT, now_ns); break;
    default: break;
    }
    return false;
}

void input_map_frame_done(struct input_map *map, int page)
{
    map->shows = true;
    map->shown_page = page;
    if (map->leaving)
        map->pointer_there = map->leaving = false;
}

bool input_map_pad(const struct input_map *map, struct view_state *state, double passed_s, int64_t now_ns)
{
    const double x = map->pad[PAD_LEFT_X], y = map->pad[PAD_LEFT_Y], yaw = map->pad[PAD_RIGHT_X],
                 zoom = -map->pad[PAD_RIGHT_Y];
    const double seek = map->pad[PAD_RIGHT_TRIGGER] - map->pad[PAD_LEFT_TRIGGER];
    if (state->page == PAGE_LIVE && (x != 0 || y != 0 || zoom != 0)) {
        orbit_move(&state->live.orbit, -0.6 * passed_s * x, 0.6 * passed_s * y, 8 * passed_s * zoom);
        view_state_on_input(state, now_ns);
        return true;
    }
    if (state->page != PAGE_WATCH || (x == 0 && y == 0 && yaw == 0 && zoom == 0 && seek == 0))
        return false;
    if (state->moving) { // one metre per second, relative to the orbit's direction
        double a = state->orbit.angle_rad;
        state->placement.x_m += passed_s * (x * cos(a) + y * sin(a));
        state->placement.y_m += passed_s * (x * sin(a) - y * cos(a));
        view_state_set_yaw(state, state->placement.yaw_rad + 1.5 * passed_s * yaw);
    } else if (state->orbiting) {
        orbit_move(&state->orbit, -0.6 * passed_s * x, 0.6 * passed_s * y, state->room.map ? 0 : 8 * passed_s * zoom);
    }
    if (state->room.map && !state->moving) // the right stick turns the map
        orbit_move(&state->room.map_orbit, -0.6 * passed_s * yaw, -0.6 * passed_s * zoom, 0);
    if (seek != 0) {
        int64_t at = playback_at(&state->playback, now_ns);
        playback_seek(&state->playback, now_ns, at + (int64_t)(3e9 * passed_s * seek));
    }
    view_state_on_input(state, now_ns);
    return true;
}
