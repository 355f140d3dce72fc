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

void studio_rate_see(struct studio_rate *r, const struct frame *frame, const struct calibration *calibration,
                     int64_t now_ns)
{
    const struct lens *color = &calibration->color, *depth = &calibration->depth;
    if ((r->frame_bytes > 0 && now_ns - r->measured_ns < EVERY_NS) || (!r->coder && depth_coder_open(&r->coder) != OK))
        return;
    uint8_t *jpeg = NULL;
    const uint8_t *coded;
    size_t jpeg_bytes = 0, depth_bytes = 0;
    r->measured_ns = now_ns;
    if (frame->jpeg)
        jpeg_bytes = frame->jpeg_bytes;
    else if (frame->color && jpeg_encode(frame->color, color->width, color->height, QUALITY, &jpeg, &jpeg_bytes) != OK)
        return;
    free(jpeg);
    if (frame->depth && depth_encode(r->coder, frame->depth, depth->width, depth->height, &coded, &depth_bytes) != OK)
        return;
    r->frame_bytes = (double)(jpeg_bytes + depth_bytes);
}

void studio_rate_close(struct studio_rate *r)
{
    depth_coder_close(&r->coder);
    *r = (struct studio_rate){0};
}

// ---------------------------------------------------------------- studio state

static const int64_t SECOND_NS = 1000000000, NOTICE_NS = 4 * 1000000000LL, LOOK_NS = 2 * 1000000000LL;

struct studio_state studio_start(bool dark)
{
    return (struct studio_state){.dark = dark, .text_size = 1, .changed = true, .number = 1, .sensor = -1};
}

static void command(struct studio_state *s, enum studio_command c)
{
    if (s->queued < STUDIO_COMMANDS)
        s->queue[s->queued++] = c;
}

bool studio_take_command(struct studio_state *s, enum studio_command *out)
{
    if (!s->queued)
        return false;
    *out = s->queue[0];
    memmove(s->queue, s->queue + 1, (size_t)--s->queued * sizeof *s->queue);
    return true;
}

static void go(struct studio_state *s, enum studio_page page, int64_t now_ns)
{
    s->page = page;
    s->page_ns = now_ns;
    s->changed = true;
}

int studio_take_number(const char *name)
{
    enum { FIRST = 5, DIGITS_MOST = 9 }; // of "take-", and what an int holds
    const size_t length = strlen(name);
    if (strncmp(name, "take-", FIRST) != 0 || length > FIRST + DIGITS_MOST ||
        FIRST + strspn(name + FIRST, "0123456789") != length)
        return 0;
    return atoi(name + FIRST);
}

void studio_set_sensors(struct studio_state *s, int count, int64_t now_ns)
{
    s->sensor_count = count;
    s->changed = true;
    (void)now_ns;
}

void studio_choose_sensor(struct studio_state *s, int sensor, int64_t now_ns)
{
    if (s->page != STUDIO_SENSORS || sensor < 0 || sensor >= s->sensor_count)
        return;
    s->sensor = sensor;
    command(s, STUDIO_OPEN_SENSOR);
    go(s, STUDIO_OPENING, now_ns);
}

void studio_sensor_ready(struct studio_state *s, int64_t now_ns)
{
    if (s->page == STUDIO_OPENING || s->page == STUDIO_TROUBLE)
        go(s, STUDIO_LIVE, now_ns);
}

static void begin_countdown(struct studio_state *s, int64_t now_ns)
{
    s->left_s = STUDIO_COUNTDOWN_S;
    command(s, STUDIO_TONE);
    go(s, STUDIO_COUNTDOWN, now_ns);
}

static void start_or_stop(struct studio_state *s, int64_t now_ns)
{
    if (s->page == STUDIO_LIVE) {
        begin_countdown(s, now_ns);
    } else if (s->page == STUDIO_COUNTDOWN) { // taken back
        go(s, STUDIO_LIVE, now_ns);
    } else if (s->page == STUDIO_RECORDING) {
        s->paused = false;
        command(s, STUDIO_END_TAKE);
        command(s, STUDIO_TONE_END);
        go(s, STUDIO_FINISHING, now_ns);
    } else if (s->page == STUDIO_ROOM) {
        command(s, STUDIO_END_SWEEP);
        go(s, STUDIO_ROOM_FINISHING, now_ns);
    }
}

static void pause_or_go_on(struct studio_state *s)
{
    if (s->page != STUDIO_RECORDING)
        return;
    s->paused = !s->paused;
    command(s, s->paused ? STUDIO_PAUSE_TAKE : STUDIO_RESUME_TAKE);
    command(s, STUDIO_TONE);
}

static void begin_sweep(struct studio_state *s, int64_t now_ns)
{
    if (s->page != STUDIO_LIVE)
        return;
    command(s, STUDIO_BEGIN_SWEEP);
    go(s, STUDIO_ROOM, now_ns);
}

static void do_in_room_review(struct studio_state *s, enum studio_action action, int64_t now_ns)
{
    if (action != STUDIO_KEEP && action != STUDIO_DISCARD && action != STUDIO_RETAKE)
        return;
    command(s, action == STUDIO_KEEP ? STUDIO_KEEP_ROOM : STUDIO_DROP_ROOM);
    go(s, STUDIO_LIVE, now_ns);
    if (action == STUDIO_RETAKE)
        begin_sweep(s, now_ns);
}

// ---------------------------------------------------------------- what can be taken back

int studio_undo_left_s(const struct studio_state *s, int64_t now_ns)
{
    if (s->waiting.kind == ERASES_NOTHING)
        return 0;
    const int left = STUDIO_UNDO_S - (int)((now_ns - s->waiting.since_ns) / SECOND_NS);
    return left > 1 ? left : 1;
}

// The file is changed now.
static void erase_waiting(struct studio_state *s)
{
    if (s->waiting.kind == ERASES_NOTHING)
        return;
    s->erasing = s->waiting;
    s->waiting.kind = ERASES_NOTHING;
    s->discarded += s->erasing.kind == ERASES_TAKE;
    command(s, s->erasing.kind == ERASES_TAKE ? STUDIO_DELETE_TAKE : STUDIO_TRIM_TAKE);
    s->changed = true;
}

// Of the same take the last wish counts; another one's is carried out first.
static void erase_later(struct studio_state *s, enum studio_erasure_kind kind, int64_t now_ns)
{
    if (strcmp(s->waiting.take, s->take) != 0)
        erase_waiting(s);
    s->waiting =
        (struct studio_erasure){.kind = kind, .from_ns = s->trim_from_ns, .to_ns = s->trim_to_ns, .since_ns = now_ns};
    memcpy(s->waiting.take, s->take, sizeof s->waiting.take);
    s->changed = true;
}

void studio_erasure_failed(struct studio_state *s, const char *why, bool again, int64_t now_ns)
{
    s->discarded -= s->erasing.kind == ERASES_TAKE;
    if (again && !s->quit && s->waiting.kind == ERASES_NOTHING) {
        s->waiting = s->erasing;
        s->waiting.since_ns = now_ns;
    }
    studio_say(s, why, now_ns);
}

static void undo(struct studio_state *s, int64_t now_ns)
{
    char text[sizeof s->notice];
    const struct studio_erasure back = s->waiting;
    if (back.kind == ERASES_NOTHING)
        return;
    s->waiting.kind = ERASES_NOTHING;
    // Back to its verdict, where nothing has come in between; else it is kept.
    if (back.kind == ERASES_TAKE && s->page == STUDIO_LIVE && !strcmp(back.take, s->take))
        go(s, STUDIO_REVIEW, now_ns);
    else
        s->kept += back.kind == ERASES_TAKE;
    snprintf(text, sizeof text, "%.60s is as it was", back.take);
    studio_say(s, text, now_ns);
}

// While a take is written the file has another writer; while one is played it is not changed under the viewer.
static bool may_erase(const struct studio_state *s)
{
    return s->page != STUDIO_RECORDING && s->page != STUDIO_FINISHING && s->page != STUDIO_PLAYBACK;
}

static void look_at_waiting(struct studio_state *s, int64_t now_ns)
{
    const int left_s = studio_undo_left_s(s, now_ns);
    s->changed |= left_s != s->undo_left_s;
    s->undo_left_s = left_s;
    if (s->page == STUDIO_PLAYBACK) // who looks at it once more has all the time again
        s->waiting.since_ns = now_ns;
    if (may_erase(s) && (s->quit || now_ns - s->waiting.since_ns >= STUDIO_UNDO_S * SECOND_NS))
        erase_waiting(s);
}

// ---------------------------------------------------------------- the verdict

static void leave_review(struct studio_state *s, enum studio_action action, int64_t now_ns)
{
    if (action == STUDIO_KEEP)
        s->kept++;
    else
        erase_later(s, ERASES_TAKE, now_ns);
    s->number++; // also of a discarded one: until it is gone, its name is taken
    if (action == STUDIO_RETAKE)
        begin_countdown(s, now_ns);
    else
        go(s, STUDIO_LIVE, now_ns);
}

// A take that is being recorded is ended and kept first; leaving waits for that. For a take that is neither kept nor
// discarded the user is asked once.
static void leave(struct studio_state *s, int64_t now_ns)
{
    if (s->page == STUDIO_RECORDING)
        start_or_stop(s, now_ns);
    if (s->page == STUDIO_PLAYBACK)
        command(s, STUDIO_CLOSE_PLAYBACK);
    if (s->page == STUDIO_REVIEW || s->page == STUDIO_RENAME || s->page == STUDIO_PLAYBACK) {
        go(s, STUDIO_LEAVING, now_ns);
        return;
    }
    if (s->page == STUDIO_LEAVING)
        leave_review(s, STUDIO_KEEP, now_ns);
    s->quit = true;
}

static void do_in_leaving(struct studio_state *s, enum studio_action action, int64_t now_ns)
{
    if (action != STUDIO_KEEP && action != STUDIO_DISCARD)
        return;
    leave_review(s, action, now_ns);
    s->quit = true;
}

static void do_in_review(struct studio_state *s, enum studio_action action, int64_t now_ns)
{
    switch (action) {
    case STUDIO_KEEP:
    case STUDIO_DISCARD:
    case STUDIO_RETAKE: leave_review(s, action, now_ns); break;
    case STUDIO_PLAY:
        command(s, STUDIO_OPEN_PLAYBACK);
        go(s, STUDIO_PLAYBACK, now_ns);
        break;
    case STUDIO_EDIT_NAME:
        snprintf(s->name, sizeof s->name, "%s", s->take);
        go(s, STUDIO_RENAME, now_ns);
        break;
    default: break;
    }
}

static void go_back(struct studio_state *s, int64_t now_ns)
{
    switch (s->page) {
    case STUDIO_PLAYBACK:
        command(s, STUDIO_CLOSE_PLAYBACK);
        go(s, STUDIO_REVIEW, now_ns);
        break;
    case STUDIO_RENAME:
    case STUDIO_LEAVING: go(s, STUDIO_REVIEW, now_ns); break;
    case STUDIO_COUNTDOWN: go(s, STUDIO_LIVE, now_ns); break;
    case STUDIO_ROOM:
        command(s, STUDIO_DROP_SWEEP);
        go(s, STUDIO_LIVE, now_ns);
        break;
    case STUDIO_TROUBLE: go(s, STUDIO_SENSORS, now_ns); break;
    default: break; // a take is never lost by a key
    }
}

void studio_do(struct studio_state *s, enum studio_action action, int64_t now_ns)
{
    s->changed = true;
    switch (action) {
    case STUDIO_THEME: s->dark = !s->dark; return;
    case STUDIO_TEXT_SIZE: s->text_size = s->text_size > 1.4 ? 1 : s->text_size + 0.25; return;
    case STUDIO_QUIT: leave(s, now_ns); return;
    case STUDIO_UNDO: undo(s, now_ns); return;
    case STUDIO_START: start_or_stop(s, now_ns); return;
    case STUDIO_PAUSE: pause_or_go_on(s); return;
    case STUDIO_IN_A_ROW: s->in_a_row = !s->in_a_row; return;
    case STUDIO_PURPOSE:
        s->purpose = (s->purpose + 1) % STUDIO_PURPOSES;
        command(s, STUDIO_CHOOSE_PURPOSE);
        return;
    case STUDIO_MAP_ROOM: begin_sweep(s, now_ns); return;
    case STUDIO_TRIM:
        if (s->page == STUDIO_PLAYBACK) {
            command(s, STUDIO_CLOSE_PLAYBACK);
            erase_later(s, ERASES_ENDS, now_ns);
            go(s, STUDIO_REVIEW, now_ns);
        }
        return;
    case STUDIO_BACK: go_back(s, now_ns); return;
    case STUDIO_SENSORS_AGAIN:
        command(s, STUDIO_LIST_SENSORS);
        if (s->page == STUDIO_TROUBLE)
            go(s, STUDIO_SENSORS, now_ns);
        return;
    default: break;
    }
    if (s->page == STUDIO_REVIEW)
        do_in_review(s, action, now_ns);
    else if (s->page == STUDIO_LEAVING)
        do_in_leaving(s, action, now_ns);
    else if (s->page == STUDIO_ROOM_REVIEW)
        do_in_room_review(s, action, now_ns);
}

void studio_type(struct studio_state *s, const char *text)
{
    if (s->page == STUDIO_RENAME)
        s->changed |= text_append(s->name, sizeof s->name, text);
}

void studio_type_back(struct studio_state *s)
{
    if (s->page == STUDIO_RENAME)
        text_remove_last(s->name);
    s->changed = true;
}

void studio_type_done(struct studio_state *s, int64_t now_ns)
{
    if (s->page != STUDIO_RENAME)
        return;
    if (*s->name && strcmp(s->name, s->take))
        command(s, STUDIO_RENAME_TAKE);
    else
        go(s, STUDIO_REVIEW, now_ns);
}

void studio_renamed(struct studio_state *s, bool done, int64_t now_ns)
{
    if (done) {
        const int number = studio_take_number(s->name);
        if (!strcmp(s->waiting.take, s->take))
            memcpy(s->waiting.take, s->name, sizeof s->waiting.take);
        memcpy(s->take, s->name, sizeof s->take);
        s->number = number > s->number ? number : s->number; // a later take must not come to have the same name
    }
    go(s, STUDIO_REVIEW, now_ns);
}

void studio_take_finishing(struct studio_state *s, int64_t now_ns)
{
    if (s->page == STUDIO_RECORDING) // a film ended by itself
        go(s, STUDIO_FINISHING, now_ns);
    s->changed = true;
}

void studio_take_ready(struct studio_state *s, int64_t frames, int64_t now_ns)
{
    if (s->page != STUDIO_RECORDING && s->page != STUDIO_FINISHING)
        return;
    s->paused = false;
    if (frames == 0) { // stopped before the sensor gave a picture
        go(s, STUDIO_LIVE, now_ns);
        studio_say(s, "nothing was filmed", now_ns);
        return;
    }
    go(s, STUDIO_REVIEW, now_ns);
    if (s->in_a_row || s->quit) // who has left already is not asked
        leave_review(s, STUDIO_KEEP, now_ns);
}

void studio_sweep_finishing(struct studio_state *s, int64_t now_ns)
{
    if (s->page == STUDIO_ROOM) // a film ended by itself
        go(s, STUDIO_ROOM_FINISHING, now_ns);
}

void studio_sweep_ready(struct studio_state *s, int64_t now_ns)
{
    if (s->page == STUDIO_ROOM || s->page == STUDIO_ROOM_FINISHING)
        go(s, STUDIO_ROOM_REVIEW, now_ns);
}

void studio_room_not_kept(struct studio_state *s, const char *why, int64_t now_ns)
{
    if (s->page == STUDIO_LIVE || s->page == STUDIO_COUNTDOWN)
        go(s, STUDIO_ROOM_REVIEW, now_ns);
    studio_say(s, why, now_ns);
}

void studio_fail(struct studio_state *s, const char *sentence, int64_t now_ns)
{
    snprintf(s->trouble, sizeof s->trouble, "%s", sentence);
    go(s, STUDIO_TROUBLE, now_ns);
}

void studio_say(struct studio_state *s, const char *sentence, int64_t now_ns)
{
    snprintf(s->notice, sizeof s->notice, "%s", sentence);
    s->notice_ns = now_ns;
    s->changed = true;
}

// What is plugged in while the page waits for it is found without a touch.
static void look_again(struct studio_state *s, int64_t now_ns)
{
    const bool waits = s->page == STUDIO_TROUBLE || (s->page == STUDIO_SENSORS && !s->sensor_count);
    if (!waits || now_ns - s->looked_ns < LOOK_NS || now_ns - s->page_ns < LOOK_NS)
        return;
    s->looked_ns = now_ns;
    command(s, s->page == STUDIO_TROUBLE ? STUDIO_OPEN_SENSOR : STUDIO_LIST_SENSORS);
}

int64_t studio_tick(struct studio_state *s, int64_t now_ns)
{
    if (*s->notice && now_ns - s->notice_ns > NOTICE_NS) {
        *s->notice = 0;
        s->changed = true;
    }
    look_again(s, now_ns);
    if (s->waiting.kind != ERASES_NOTHING)
        look_at_waiting(s, now_ns);
    if (s->page != STUDIO_COUNTDOWN)
        return now_ns + SECOND_NS / 10;
    const int left = STUDIO_COUNTDOWN_S - (int)((now_ns - s->page_ns) / SECOND_NS);
    if (left <= 0) {
        snprintf(s->take, sizeof s->take, "take-%d", s->number);
        command(s, STUDIO_BEGIN_TAKE);
        command(s, STUDIO_TONE_BEGIN);
        go(s, STUDIO_RECORDING, now_ns);
    } else if (left != s->left_s) {
        s->left_s = left;
        s->changed = true;
        command(s, STUDIO_TONE);
    }
    return now_ns + SECOND_NS / 20;
}
