#include "app/ui/input_map.h"

static const double TAP_DP = 16;

enum show_action hands_key(int key, bool shift)
{
    switch (key) {
    case SCREEN_KEY_SPACE: return DO_PLAY_PAUSE;
    case SCREEN_KEY_ENTER: return DO_CHOOSE;
    case SCREEN_KEY_LEFT: return shift ? DO_TO_START : DO_STEP_BACK;
    case SCREEN_KEY_RIGHT: return shift ? DO_TO_END : DO_STEP_ON;
    case SCREEN_KEY_UP: return DO_PREVIOUS;
    case SCREEN_KEY_DOWN: return DO_NEXT;
    case SCREEN_KEY_HOME: return DO_TO_START;
    case SCREEN_KEY_END: return DO_TO_END;
    case SCREEN_KEY_ESCAPE:
    case SCREEN_KEY_BACK: return DO_BACK;
    case SCREEN_KEY_F11:
    case 'f': return DO_FULLSCREEN;
    case '-':
    case '[': return DO_SLOWER;
    case '+':
    case '=':
    case ']': return DO_FASTER;
    case 'l': return DO_LOOP;
    case 'm': return DO_MIRROR;
    case 'o': return DO_ORBIT;
    case 'b': return DO_SKELETON;
    case 'x': return DO_SOURCES;
    case 'i': return DO_INSET;
    case 't': return DO_STRIP;
    case 'd': return DO_THEME;
    case 'g': return DO_MOVE;
    case 'r': return DO_PUT_BACK;
    case 'p': return DO_PHOTOGRAPH;
    case 'q': return DO_QUIT;
    default: return DO_NOTHING;
    }
}

enum show_action hands_button(enum screen_button button)
{
    static const enum show_action actions[PAD_BUTTONS] = {
        [PAD_A] = DO_CHOOSE,
        [PAD_B] = DO_BACK,
        [PAD_X] = DO_PHOTOGRAPH,
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

static void point(struct hands *h, const struct screen_event *e, double px_per_dp)
{
    h->pointer_x = e->x / px_per_dp;
    h->pointer_y = e->y / px_per_dp;
    h->pointer_there = true;
    h->leaving = false;
}

static bool hear_pointer(struct hands *h, struct show *show, const struct screen_event *e, double px_per_dp,
                         int64_t now_ns)
{
    const double x = e->x / px_per_dp, y = e->y / px_per_dp;
    const bool first = h->pointer_down && h->pointer == e->pointer, mouse = e->pointer < 0;
    switch (e->kind) {
    case SCREEN_POINTER_DOWN:
        gesture_down(&h->gesture, e->pointer, x, y, now_ns);
        if (h->pointer_down)
            return false;
        point(h, e, px_per_dp);
        h->pointer_down = true;
        h->pointer = e->pointer;
        break;
    case SCREEN_POINTER_UP:
        gesture_up(&h->gesture, e->pointer, TAP_DP, now_ns);
        if (!first)
            return false;
        point(h, e, px_per_dp);
        h->pointer_down = false;
        h->leaving = !mouse;
        break;
    default:
        gesture_move(&h->gesture, e->pointer, x, y);
        if (first || (mouse && !h->pointer_down))
            point(h, e, px_per_dp);
        show->changed = true;
        return false;
    }
    show->changed = true;
    return true;
}

bool hands_hear(struct hands *h, struct show *show, const struct screen_event *e, double px_per_dp, int64_t now_ns)
{
    switch (e->kind) {
    case SCREEN_POINTER_DOWN:
    case SCREEN_POINTER_MOVE:
    case SCREEN_POINTER_UP: return hear_pointer(h, show, e, px_per_dp, now_ns);
    case SCREEN_WHEEL: h->wheel += e->amount; break;
    case SCREEN_KEY: show_do(show, hands_key(e->key, e->shift), now_ns); break;
    case SCREEN_PAD_BUTTON: show_do(show, hands_button(e->button), now_ns); break;
    case SCREEN_PAD_AXIS: h->pad[e->axis] = e->amount; break;
    case SCREEN_RESIZED: show->changed = true; break;
    case SCREEN_QUIT: show_do(show, DO_QUIT, now_ns); break;
    default: break;
    }
    return false;
}

void hands_drawn(struct hands *h)
{
    if (h->leaving)
        h->pointer_there = h->leaving = false;
}

bool hands_pad(const struct hands *h, struct show *show, double passed_s, int64_t now_ns)
{
    const double x = h->pad[PAD_LEFT_X], y = h->pad[PAD_LEFT_Y], turn = h->pad[PAD_RIGHT_X],
                 near = -h->pad[PAD_RIGHT_Y];
    const double wind = h->pad[PAD_RIGHT_TRIGGER] - h->pad[PAD_LEFT_TRIGGER];
    if (show->page != PAGE_WATCH || (x == 0 && y == 0 && turn == 0 && near == 0 && wind == 0))
        return false;
    if (show->moving) { // a metre a second, as seen from where the orbit looks
        double a = show->orbit.angle_rad;
        show->placement.x_m += passed_s * (x * cos(a) + y * sin(a));
        show->placement.y_m += passed_s * (x * sin(a) - y * cos(a));
        show_set_turn(show, show->placement.turn_rad + 1.5 * passed_s * turn);
    } else if (show->orbiting) {
        orbit_move(&show->orbit, -0.6 * passed_s * x, 0.6 * passed_s * y, 8 * passed_s * near);
    }
    if (wind != 0) {
        int64_t at = player_at(&show->player, now_ns);
        player_seek(&show->player, now_ns, at + (int64_t)(3e9 * passed_s * wind));
    }
    show_stir(show, now_ns);
    return true;
}
