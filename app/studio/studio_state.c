#include "app/studio/studio_state.h"

#include "base/text.h"
#include "platform/files/jpeg.h"
#include "recording/depth_codec.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- studio rate

static const int64_t EVERY_NS = 2000000000;
enum { QUALITY = 92 }; // as the recorder's

void studio_rate_see(struct studio_rate *rate, const struct frame *frame, const struct calibration *calibration,
                     int64_t now_ns)
{
    const struct lens *color = &calibration->color, *depth = &calibration->depth;
    if ((rate->frame_bytes > 0 && now_ns - rate->measured_ns < EVERY_NS) ||
        (!rate->coder && depth_coder_open(&rate->coder) != OK))
        return;
    uint8_t *jpeg = NULL;
    const uint8_t *coded;
    size_t jpeg_bytes = 0, depth_bytes = 0;
    rate->measured_ns = now_ns;
    if (frame->jpeg)
        jpeg_bytes = frame->jpeg_bytes;
    else if (frame->color && jpeg_encode(frame->color, color->width, color->height, QUALITY, &jpeg, &jpeg_bytes) != OK)
        return;
    free(jpeg);
    if (frame->depth &&
        depth_encode(rate->coder, frame->depth, depth->width, depth->height, &coded, &depth_bytes) != OK)
        return;
    rate->frame_bytes = (double)(jpeg_bytes + depth_bytes);
}

void studio_rate_close(struct studio_rate *rate)
{
    depth_coder_close(&rate->coder);
    *rate = (struct studio_rate){0};
}

// ---------------------------------------------------------------- studio state

static const int64_t SECOND_NS = 1000000000, NOTICE_NS = 4 * 1000000000LL, LOOK_NS = 2 * 1000000000LL;

struct studio_state studio_start(bool dark)
{
    return (struct studio_state){.dark = dark, .text_size = 1, .changed = true, .number = 1, .sensor = -1};
}

static void command(struct studio_state *state, enum studio_command studio_command)
{
    if (state->queued < STUDIO_COMMANDS)
        state->queue[state->queued++] = studio_command;
}

bool studio_take_command(struct studio_state *state, enum studio_command *out)
{
    if (!state->queued)
        return false;
    *out = state->queue[0];
    memmove(state->queue, state->queue + 1, (size_t)--state->queued * sizeof *state->queue);
    return true;
}

static void go(struct studio_state *state, enum studio_page page, int64_t now_ns)
{
    state->page = page;
    state->page_ns = now_ns;
    state->changed = true;
}

int studio_take_number(const char *name)
{
    enum { FIRST = 5, DIGITS_MAX = 9 }; // of "take-", and what an int holds
    const size_t length = strlen(name);
    if (strncmp(name, "take-", FIRST) != 0 || length > FIRST + DIGITS_MAX ||
        FIRST + strspn(name + FIRST, "0123456789") != length)
        return 0;
    return atoi(name + FIRST);
}

void studio_set_sensors(struct studio_state *state, int count, int64_t now_ns)
{
    state->sensor_count = count;
    state->changed = true;
    (void)now_ns;
}

void studio_choose_sensor(struct studio_state *state, int sensor, int64_t now_ns)
{
    if (state->page != STUDIO_SENSORS || sensor < 0 || sensor >= state->sensor_count)
        return;
    state->sensor = sensor;
    command(state, STUDIO_OPEN_SENSOR);
    go(state, STUDIO_OPENING, now_ns);
}

void studio_sensor_ready(struct studio_state *state, int64_t now_ns)
{
    if (state->page == STUDIO_OPENING || state->page == STUDIO_TROUBLE)
        go(state, STUDIO_LIVE, now_ns);
}

static void begin_countdown(struct studio_state *state, int64_t now_ns)
{
    state->left_s = STUDIO_COUNTDOWN_S;
    command(state, STUDIO_TONE);
    go(state, STUDIO_COUNTDOWN, now_ns);
}

static void start_or_stop(struct studio_state *state, int64_t now_ns)
{
    if (state->page == STUDIO_LIVE) {
        begin_countdown(state, now_ns);
    } else if (state->page == STUDIO_COUNTDOWN) { // taken back
        go(state, STUDIO_LIVE, now_ns);
    } else if (state->page == STUDIO_RECORDING) {
        state->paused = false;
        command(state, STUDIO_END_TAKE);
        command(state, STUDIO_TONE_END);
        go(state, STUDIO_FINISHING, now_ns);
    } else if (state->page == STUDIO_ROOM) {
        command(state, STUDIO_END_SWEEP);
        go(state, STUDIO_ROOM_FINISHING, now_ns);
    }
}

static void pause_or_go_on(struct studio_state *state)
{
    if (state->page != STUDIO_RECORDING)
        return;
    state->paused = !state->paused;
    command(state, state->paused ? STUDIO_PAUSE_TAKE : STUDIO_RESUME_TAKE);
    command(state, STUDIO_TONE);
}

static void begin_sweep(struct studio_state *state, int64_t now_ns)
{
    if (state->page != STUDIO_LIVE)
        return;
    command(state, STUDIO_BEGIN_SWEEP);
    go(state, STUDIO_ROOM, now_ns);
}

static void do_in_room_review(struct studio_state *state, enum studio_action action, int64_t now_ns)
{
    if (action != STUDIO_KEEP && action != STUDIO_DISCARD && action != STUDIO_RETAKE)
        return;
    command(state, action == STUDIO_KEEP ? STUDIO_KEEP_ROOM : STUDIO_DROP_ROOM);
    go(state, STUDIO_LIVE, now_ns);
    if (action == STUDIO_RETAKE)
        begin_sweep(state, now_ns);
}

// ---------------------------------------------------------------- what can be taken back

int studio_undo_left_s(const struct studio_state *state, int64_t now_ns)
{
    if (state->waiting.kind == ERASES_NOTHING)
        return 0;
    const int left = STUDIO_UNDO_S - (int)((now_ns - state->waiting.since_ns) / SECOND_NS);
    return left > 1 ? left : 1;
}

// The file is changed now.
static void erase_waiting(struct studio_state *state)
{
    if (state->waiting.kind == ERASES_NOTHING)
        return;
    state->erasing = state->waiting;
    state->waiting.kind = ERASES_NOTHING;
    state->discarded += state->erasing.kind == ERASES_TAKE;
    command(state, state->erasing.kind == ERASES_TAKE ? STUDIO_DELETE_TAKE : STUDIO_TRIM_TAKE);
    state->changed = true;
}

// Of the same take the last wish counts; another one's is carried out first.
static void erase_later(struct studio_state *state, enum studio_erasure_kind kind, int64_t now_ns)
{
    if (strcmp(state->waiting.take, state->take) != 0)
        erase_waiting(state);
    state->waiting = (struct studio_erasure){
        .kind = kind, .from_ns = state->trim_from_ns, .to_ns = state->trim_to_ns, .since_ns = now_ns};
    memcpy(state->waiting.take, state->take, sizeof state->waiting.take);
    state->changed = true;
}

void studio_erasure_failed(struct studio_state *state, const char *why, bool again, int64_t now_ns)
{
    state->discarded -= state->erasing.kind == ERASES_TAKE;
    if (again && !state->quit && state->waiting.kind == ERASES_NOTHING) {
        state->waiting = state->erasing;
        state->waiting.since_ns = now_ns;
    }
    studio_say(state, why, now_ns);
}

static void undo(struct studio_state *state, int64_t now_ns)
{
    char text[sizeof state->notice];
    const struct studio_erasure back = state->waiting;
    if (back.kind == ERASES_NOTHING)
        return;
    state->waiting.kind = ERASES_NOTHING;
    // Back to its verdict, where nothing has come in between; else it is kept.
    if (back.kind == ERASES_TAKE && state->page == STUDIO_LIVE && !strcmp(back.take, state->take))
        go(state, STUDIO_REVIEW, now_ns);
    else
        state->kept += back.kind == ERASES_TAKE;
    snprintf(text, sizeof text, "%.60s is as it was", back.take);
    studio_say(state, text, now_ns);
}

// While a take is written the file has another writer; while one is played it is not changed under the viewer.
static bool may_erase(const struct studio_state *state)
{
    return state->page != STUDIO_RECORDING && state->page != STUDIO_FINISHING && state->page != STUDIO_PLAYBACK;
}

static void look_at_waiting(struct studio_state *state, int64_t now_ns)
{
    const int left_s = studio_undo_left_s(state, now_ns);
    state->changed |= left_s != state->undo_left_s;
    state->undo_left_s = left_s;
    if (state->page == STUDIO_PLAYBACK) // who looks at it once more has all the time again
        state->waiting.since_ns = now_ns;
    if (may_erase(state) && (state->quit || now_ns - state->waiting.since_ns >= STUDIO_UNDO_S * SECOND_NS))
        erase_waiting(state);
}

// ---------------------------------------------------------------- the verdict

static void leave_review(struct studio_state *state, enum studio_action action, int64_t now_ns)
{
    if (action == STUDIO_KEEP)
        state->kept++;
    else
        erase_later(state, ERASES_TAKE, now_ns);
    state->number++; // also of a discarded one: until it is gone, its name is taken
    if (action == STUDIO_RETAKE)
        begin_countdown(state, now_ns);
    else
        go(state, STUDIO_LIVE, now_ns);
}

// A take that is being recorded is ended and kept first; leaving waits for that. For a take that is neither kept nor
// discarded the user is asked once.
static void leave(struct studio_state *state, int64_t now_ns)
{
    if (state->page == STUDIO_RECORDING)
        start_or_stop(state, now_ns);
    if (state->page == STUDIO_PLAYBACK)
        command(state, STUDIO_CLOSE_PLAYBACK);
    if (state->page == STUDIO_REVIEW || state->page == STUDIO_RENAME || state->page == STUDIO_PLAYBACK) {
        go(state, STUDIO_LEAVING, now_ns);
        return;
    }
    if (state->page == STUDIO_LEAVING)
        leave_review(state, STUDIO_KEEP, now_ns);
    state->quit = true;
}

static void do_in_leaving(struct studio_state *state, enum studio_action action, int64_t now_ns)
{
    if (action != STUDIO_KEEP && action != STUDIO_DISCARD)
        return;
    leave_review(state, action, now_ns);
    state->quit = true;
}

static void do_in_review(struct studio_state *state, enum studio_action action, int64_t now_ns)
{
    switch (action) {
    case STUDIO_KEEP:
    case STUDIO_DISCARD:
    case STUDIO_RETAKE: leave_review(state, action, now_ns); break;
    case STUDIO_PLAY:
        command(state, STUDIO_OPEN_PLAYBACK);
        go(state, STUDIO_PLAYBACK, now_ns);
        break;
    case STUDIO_EDIT_NAME:
        snprintf(state->name, sizeof state->name, "%s", state->take);
        go(state, STUDIO_RENAME, now_ns);
        break;
    default: break;
    }
}

static void go_back(struct studio_state *state, int64_t now_ns)
{
    switch (state->page) {
    case STUDIO_PLAYBACK:
        command(state, STUDIO_CLOSE_PLAYBACK);
        go(state, STUDIO_REVIEW, now_ns);
        break;
    case STUDIO_RENAME:
    case STUDIO_LEAVING: go(state, STUDIO_REVIEW, now_ns); break;
    case STUDIO_COUNTDOWN: go(state, STUDIO_LIVE, now_ns); break;
    case STUDIO_ROOM:
        command(state, STUDIO_DROP_SWEEP);
        go(state, STUDIO_LIVE, now_ns);
        break;
    case STUDIO_TROUBLE: go(state, STUDIO_SENSORS, now_ns); break;
    default: break; // a take is never lost by a key
    }
}

void studio_do(struct studio_state *state, enum studio_action action, int64_t now_ns)
{
    state->changed = true;
    switch (action) {
    case STUDIO_THEME: state->dark = !state->dark; return;
    case STUDIO_TEXT_SIZE: state->text_size = state->text_size > 1.4 ? 1 : state->text_size + 0.25; return;
    case STUDIO_QUIT: leave(state, now_ns); return;
    case STUDIO_UNDO: undo(state, now_ns); return;
    case STUDIO_START: start_or_stop(state, now_ns); return;
    case STUDIO_PAUSE: pause_or_go_on(state); return;
    case STUDIO_IN_A_ROW: state->in_a_row = !state->in_a_row; return;
    case STUDIO_PURPOSE:
        state->purpose = (state->purpose + 1) % STUDIO_PURPOSES;
        command(state, STUDIO_CHOOSE_PURPOSE);
        return;
    case STUDIO_MAP_ROOM: begin_sweep(state, now_ns); return;
    case STUDIO_TRIM:
        if (state->page == STUDIO_PLAYBACK) {
            command(state, STUDIO_CLOSE_PLAYBACK);
            erase_later(state, ERASES_ENDS, now_ns);
            go(state, STUDIO_REVIEW, now_ns);
        }
        return;
    case STUDIO_BACK: go_back(state, now_ns); return;
    case STUDIO_SENSORS_AGAIN:
        command(state, STUDIO_LIST_SENSORS);
        if (state->page == STUDIO_TROUBLE)
            go(state, STUDIO_SENSORS, now_ns);
        return;
    default: break;
    }
    if (state->page == STUDIO_REVIEW)
        do_in_review(state, action, now_ns);
    else if (state->page == STUDIO_LEAVING)
        do_in_leaving(state, action, now_ns);
    else if (state->page == STUDIO_ROOM_REVIEW)
        do_in_room_review(state, action, now_ns);
}

void studio_type(struct studio_state *state, const char *text)
{
    if (state->page == STUDIO_RENAME)
        state->changed |= text_append(state->name, sizeof state->name, text);
}

void studio_type_back(struct studio_state *state)
{
    if (state->page == STUDIO_RENAME)
        text_remove_last(state->name);
    state->changed = true;
}

void studio_type_done(struct studio_state *state, int64_t now_ns)
{
    if (state->page != STUDIO_RENAME)
        return;
    if (*state->name && strcmp(state->name, state->take))
        command(state, STUDIO_RENAME_TAKE);
    else
        go(state, STUDIO_REVIEW, now_ns);
}

void studio_renamed(struct studio_state *state, bool done, int64_t now_ns)
{
    if (done) {
        const int number = studio_take_number(state->name);
        if (!strcmp(state->waiting.take, state->take))
            memcpy(state->waiting.take, state->name, sizeof state->waiting.take);
        memcpy(state->take, state->name, sizeof state->take);
        state->number =
            number > state->number ? number : state->number; // a later take must not come to have the same name
    }
    go(state, STUDIO_REVIEW, now_ns);
}

void studio_take_finishing(struct studio_state *state, int64_t now_ns)
{
    if (state->page == STUDIO_RECORDING) // a film ended by itself
        go(state, STUDIO_FINISHING, now_ns);
    state->changed = true;
}

void studio_take_ready(struct studio_state *state, int64_t frames, int64_t now_ns)
{
    if (state->page != STUDIO_RECORDING && state->page != STUDIO_FINISHING)
        return;
    state->paused = false;
    if (frames == 0) { // stopped before the sensor gave a picture
        go(state, STUDIO_LIVE, now_ns);
        studio_say(state, "nothing was filmed", now_ns);
        return;
    }
    go(state, STUDIO_REVIEW, now_ns);
    if (state->in_a_row || state->quit) // who has left already is not asked
        leave_review(state, STUDIO_KEEP, now_ns);
}

void studio_sweep_finishing(struct studio_state *state, int64_t now_ns)
{
    if (state->page == STUDIO_ROOM) // a film ended by itself
        go(state, STUDIO_ROOM_FINISHING, now_ns);
}

void studio_sweep_ready(struct studio_state *state, int64_t now_ns)
{
    if (state->page == STUDIO_ROOM || state->page == STUDIO_ROOM_FINISHING)
        go(state, STUDIO_ROOM_REVIEW, now_ns);
}

void studio_room_not_kept(struct studio_state *state, const char *why, int64_t now_ns)
{
    if (state->page == STUDIO_LIVE || state->page == STUDIO_COUNTDOWN)
        go(state, STUDIO_ROOM_REVIEW, now_ns);
    studio_say(state, why, now_ns);
}

void studio_fail(struct studio_state *state, const char *sentence, int64_t now_ns)
{
    snprintf(state->trouble, sizeof state->trouble, "%s", sentence);
    go(state, STUDIO_TROUBLE, now_ns);
}

void studio_say(struct studio_state *state, const char *sentence, int64_t now_ns)
{
    snprintf(state->notice, sizeof state->notice, "%s", sentence);
    state->notice_ns = now_ns;
    state->changed = true;
}

// What is plugged in while the page waits for it is found without a touch.
static void look_again(struct studio_state *state, int64_t now_ns)
{
    const bool waits = state->page == STUDIO_TROUBLE || (state->page == STUDIO_SENSORS && !state->sensor_count);
    if (!waits || now_ns - state->looked_ns < LOOK_NS || now_ns - state->page_ns < LOOK_NS)
        return;
    state->looked_ns = now_ns;
    command(state, state->page == STUDIO_TROUBLE ? STUDIO_OPEN_SENSOR : STUDIO_LIST_SENSORS);
}

int64_t studio_tick(struct studio_state *state, int64_t now_ns)
{
    if (*state->notice && now_ns - state->notice_ns > NOTICE_NS) {
        *state->notice = 0;
        state->changed = true;
    }
    look_again(state, now_ns);
    if (state->waiting.kind != ERASES_NOTHING)
        look_at_waiting(state, now_ns);
    if (state->page != STUDIO_COUNTDOWN)
        return now_ns + SECOND_NS / 10;
    const int left = STUDIO_COUNTDOWN_S - (int)((now_ns - state->page_ns) / SECOND_NS);
    if (left <= 0) {
        snprintf(state->take, sizeof state->take, "take-%d", state->number);
        command(state, STUDIO_BEGIN_TAKE);
        command(state, STUDIO_TONE_BEGIN);
        go(state, STUDIO_RECORDING, now_ns);
    } else if (left != state->left_s) {
        state->left_s = left;
        state->changed = true;
        command(state, STUDIO_TONE);
    }
    return now_ns + SECOND_NS / 20;
}
