#include "app/state/live_state.h"

#include "base/clamp.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

const double live_tempos[LIVE_TEMPOS] = {0.25, 0.5, 0.75, 1, 1.25};

// All chosen by hand.
static const int64_t COUNT_NS = 3000000000; // of the count-in
static const int64_t STAND_NS = 2500000000; // a person who has been there for this long is counted in
static const int64_t GONE_NS = 700000000;   // unseen for this long: gone, and it is said
static const int64_t GIVE_UP_NS = 8000000000;
static const int64_t SECOND_NS = 1500000000;        // said for at least this long
static const int64_t LEAD_NS = 400000000;           // follow: the actor is at most so far ahead
static const int64_t TAIL_NS = 900000000;           // after the actor's end, for a person who is a little late
static const int64_t LATE_NS = 4000000000;          // follow: longer, for one who is still on the way
static const int64_t REST_NS = 1500000000;          // between two loops
static const int64_t LEAST_PART_NS = 500000000;     // a shorter part is not marked
static const int64_t LEAST_ATTEMPT_NS = 1000000000; // a shorter attempt at more than that is not judged
static const int64_t STEP_BACK_NS = 500000000, REVIEW_NS = 3000000000;
static const double AWAY_RAD = 0.3; // follow: as near to the actor's pose as this, the actor goes on

struct live_state live_state_start(bool has_camera)
{
    return (struct live_state){.present = true,
                               .has_camera = has_camera,
                               .screen = LIVE_MIRROR,
                               .pace = LIVE_FOLLOW,
                               .tempo = 1,
                               .ghost = true,
                               .hands_free = true};
}

static void enter(struct live_state *s, enum live_phase phase, int64_t now_ns)
{
    s->phase = phase;
    s->phase_ns = now_ns;
    s->end_ns = 0;
    s->waits = false;
    s->reviewing = s->too_short = false;
    if (phase != LIVE_SUMMARY)
        s->at_ns = s->marked_from_ns;
}

void live_state_to_ready(struct live_state *s, int64_t now_ns) { enter(s, LIVE_READY, now_ns); }

static void begin_attempt(struct live_state *s, int64_t now_ns)
{
    enter(s, LIVE_DOING, now_ns);
    s->attempt++;
    s->attempt_mirrored = s->mirrored;
    s->sight.judged = false; // what was judged before is of another instant
}

static void finish_attempt(struct live_state *s, int64_t now_ns)
{
    s->finished = s->attempt;
    enter(s, LIVE_SUMMARY, now_ns);
}

// Stopped before the part's end. What says nothing about the movement is not judged, nor counted.
static void stop_attempt(struct live_state *s, int64_t now_ns)
{
    if (now_ns - s->phase_ns >= LEAST_ATTEMPT_NS) {
        finish_attempt(s, now_ns);
        return;
    }
    enter(s, s->loop && s->finished ? LIVE_SUMMARY : LIVE_READY, now_ns); // of a loop, the attempt before is shown
    s->too_short = s->phase == LIVE_READY;
}

void live_state_open_take(struct live_state *s, int64_t length_ns, const struct orbit *orbit, int64_t now_ns)
{
    s->length_ns = s->marked_to_ns = length_ns;
    s->marked_from_ns = 0;
    s->loop = false;
    s->orbit = *orbit;
    s->result_count = s->results_ever = 0;
    s->finished = s->judged = s->attempt;
    s->tick_ns = now_ns;
    s->person_ns = 0;
    enter(s, LIVE_READY, now_ns);
}

// ---------------------------------------------------------------- actions

static void next_screen(struct live_state *s)
{
    s->screen = (s->screen + 1) % LIVE_SCREENS;
    if (s->screen == LIVE_ROOM && !s->has_camera)
        s->screen = LIVE_MIRROR;
}

static void change_tempo(struct live_state *s, int by)
{
    int nearest = 0;
    for (int i = 1; i < LIVE_TEMPOS; i++)
        if (fabs(live_tempos[i] - s->tempo) < fabs(live_tempos[nearest] - s->tempo))
            nearest = i;
    live_state_set_tempo(s, live_tempos[clamp_int(nearest + by, 0, LIVE_TEMPOS - 1)]);
}

void live_state_set_tempo(struct live_state *s, double tempo)
{
    s->tempo = fmin(fmax(tempo, live_tempos[0]), live_tempos[LIVE_TEMPOS - 1]);
}

static void mark(struct live_state *s, bool from)
{
    if (s->phase != LIVE_DOING && s->phase != LIVE_READY)
        return;
    if (s->phase == LIVE_READY) { // where nothing moves a mark takes the part back
        s->marked_from_ns = 0;
        s->marked_to_ns = s->length_ns;
        s->at_ns = 0;
        return;
    }
    if (from && s->at_ns + LEAST_PART_NS <= s->marked_to_ns) {
        s->marked_from_ns = s->at_ns;
    } else if (!from && s->at_ns >= s->marked_from_ns + LEAST_PART_NS) {
        s->marked_to_ns = s->at_ns;
        s->loop = true;
    }
}

// An attempt is judged by one reference throughout.
static void mirror_actor(struct live_state *s, int64_t now_ns)
{
    s->mirrored = !s->mirrored;
    if (s->phase == LIVE_DOING)
        enter(s, LIVE_COUNT_IN, now_ns);
}

static void start_or_stop(struct live_state *s, int64_t now_ns)
{
    switch (s->phase) {
    case LIVE_READY:
    case LIVE_SUMMARY: enter(s, LIVE_COUNT_IN, now_ns); break;
    case LIVE_COUNT_IN: enter(s, LIVE_READY, now_ns); break;
    case LIVE_DOING: stop_attempt(s, now_ns); break;
    }
}

void live_state_do(struct live_state *s, enum live_action action, int64_t now_ns)
{
    switch (action) {
    case LIVE_DO_START: start_or_stop(s, now_ns); break;
    case LIVE_DO_SCREEN: next_screen(s); break;
    case LIVE_DO_PACE: s->pace = s->pace == LIVE_FOLLOW ? LIVE_KEEP_UP : LIVE_FOLLOW; break;
    case LIVE_DO_SLOWER: change_tempo(s, -1); break;
    case LIVE_DO_FASTER: change_tempo(s, 1); break;
    case LIVE_DO_OVER: s->over = !s->over; break;
    case LIVE_DO_GHOST: s->ghost = !s->ghost; break;
    case LIVE_DO_HANDS_FREE: s->hands_free = !s->hands_free; break;
    case LIVE_DO_MARK_FROM: mark(s, true); break;
    case LIVE_DO_MARK_TO: mark(s, false); break;
    case LIVE_DO_LOOP: s->loop = !s->loop; break;
    case LIVE_DO_MIRROR: mirror_actor(s, now_ns); break;
    case LIVE_DO_KEEP: s->keep_wanted |= s->phase == LIVE_SUMMARY; break;
    case LIVE_DO_BACK_STEP:
        if (s->phase == LIVE_SUMMARY)
            live_state_review(s, (s->reviewing ? s->review_from_ns : s->review_at_ns) - STEP_BACK_NS);
        break;
    case LIVE_DO_ON_STEP:
        if (s->phase == LIVE_SUMMARY)
            live_state_review(s, (s->reviewing ? s->review_from_ns : s->review_at_ns) + STEP_BACK_NS);
        break;
    }
}

void live_state_review(struct live_state *s, int64_t at_ns)
{
    if (s->phase != LIVE_SUMMARY || s->review_length_ns <= 0)
        return;
    s->review_from_ns = clamp_int64(at_ns, 0, s->review_length_ns);
    s->review_at_ns = s->review_from_ns;
    s->reviewing = true;
}

// ---------------------------------------------------------------- what the sensor says

void live_state_on_sight(struct live_state *s, const struct live_sight *sight, int64_t now_ns)
{
    const bool is_new = sight->frame != s->sight.frame;
    s->frame_ns = is_new ? now_ns : s->frame_ns;
    s->sight = *sight;
    s->sight.trouble = NULL;
    snprintf(s->trouble, sizeof s->trouble, "%s", sight->trouble ? sight->trouble : "");
    if (!is_new && sight->seeing)
        return;
    if (sight->person && sight->seeing) {
        s->person_ns = s->person_ns ? s->person_ns : now_ns;
        s->gone_ns = 0;
    } else {
        s->gone_ns = s->gone_ns ? s->gone_ns : now_ns;
        if (now_ns - s->gone_ns >= GONE_NS)
            s->person_ns = 0;
    }
    if (sight->second_person)
        s->second_ns = now_ns;
}

// The person was there for less than a second of a longer part.
static bool says_nothing(const struct live_state *s, int64_t length_ns)
{
    return length_ns > 0 && length_ns < LEAST_ATTEMPT_NS && s->marked_to_ns - s->marked_from_ns >= LEAST_ATTEMPT_NS;
}

void live_state_on_result(struct live_state *s, const struct live_result *result, int64_t length_ns, int64_t now_ns)
{
    if (says_nothing(s, length_ns)) {
        s->judged = s->finished;
        if (s->phase == LIVE_SUMMARY)
            enter(s, LIVE_READY, now_ns);
        s->too_short = s->phase == LIVE_READY;
        return;
    }
    if (s->result_count == LIVE_ATTEMPTS) {
        memmove(s->results, s->results + 1, sizeof s->results - sizeof s->results[0]);
        s->result_count--;
    }
    s->results[s->result_count++] = *result;
    s->results_ever++;
    s->judged = s->finished;
    s->review_length_ns = length_ns;
    s->review_at_ns = s->review_from_ns = result->worst_ns < length_ns ? result->worst_ns : length_ns;
    s->reviewing = false;
    s->phase_ns = s->phase == LIVE_SUMMARY ? now_ns : s->phase_ns;
}

static bool person_gone(const struct live_state *s) { return s->gone_ns && s->tick_ns - s->gone_ns >= GONE_NS; }

static bool second_person(const struct live_state *s)
{
    return s->second_ns && s->tick_ns - s->second_ns < SECOND_NS && !person_gone(s);
}

// ---------------------------------------------------------------- time

// Follow: whether the person is where the actor is, in time or in pose. The pose counts too, for where the actor holds
// one, its instants look alike.
static bool person_keeps(const struct live_state *s)
{
    if (!s->sight.judged || !s->sight.person)
        return false;
    return s->at_ns <= s->sight.reference_ns + LEAD_NS || s->sight.away_rad < AWAY_RAD;
}

// At the end: whether the person has arrived, too.
static bool person_arrived(const struct live_state *s)
{
    return s->sight.judged && (s->sight.reference_ns >= s->marked_to_ns - LEAD_NS || s->sight.away_rad < AWAY_RAD);
}

static void tick_at_end(struct live_state *s, int64_t now_ns)
{
    s->end_ns = s->end_ns ? s->end_ns : now_ns;
    const int64_t since_ns = now_ns - s->end_ns;
    const bool late = s->pace == LIVE_FOLLOW && !person_arrived(s);
    if (since_ns < (late ? LATE_NS : TAIL_NS))
        return;
    if (!s->loop) {
        finish_attempt(s, now_ns);
        return;
    }
    if (s->finished != s->attempt)
        s->finished = s->attempt; // judged while the person rests
    if (since_ns >= TAIL_NS + REST_NS || late)
        begin_attempt(s, now_ns);
}

static void tick_doing(struct live_state *s, int64_t now_ns, int64_t passed_ns)
{
    if (s->gone_ns && now_ns - s->gone_ns >= GIVE_UP_NS) {
        enter(s, LIVE_READY, now_ns);
        return;
    }
    if (s->sight.ended) {
        stop_attempt(s, now_ns);
        return;
    }
    s->waits = s->pace == LIVE_FOLLOW && !person_keeps(s) && s->at_ns < s->marked_to_ns;
    if (!s->waits)
        s->at_ns += (int64_t)((double)passed_ns * s->tempo);
    if (s->at_ns >= s->marked_to_ns) {
        s->at_ns = s->marked_to_ns;
        tick_at_end(s, now_ns);
    }
}

static void tick_review(struct live_state *s, int64_t passed_ns)
{
    s->review_at_ns += passed_ns;
    if (s->review_at_ns < s->review_from_ns + REVIEW_NS && s->review_at_ns < s->review_length_ns)
        return;
    s->review_at_ns = s->review_from_ns; // rests at the place that was touched
    s->reviewing = false;
}

int64_t live_state_tick(struct live_state *s, int64_t now_ns)
{
    const int64_t passed_ns = clamp_int64(now_ns - s->tick_ns, 0, 100000000); // a longer stall moves no one
    s->tick_ns = now_ns;
    const bool there = s->person_ns && !person_gone(s);
    switch (s->phase) {
    case LIVE_READY:
        if (s->hands_free && there && now_ns - s->person_ns >= STAND_NS && now_ns - s->phase_ns >= STAND_NS)
            enter(s, LIVE_COUNT_IN, now_ns);
        return there ? now_ns : INT64_MAX;
    case LIVE_COUNT_IN:
        if (now_ns - s->phase_ns >= COUNT_NS)
            begin_attempt(s, now_ns);
        else if (person_gone(s))
            enter(s, LIVE_READY, now_ns);
        return now_ns;
    case LIVE_DOING: tick_doing(s, now_ns, passed_ns); return now_ns;
    case LIVE_SUMMARY:
        if (!s->reviewing)
            return s->judged != s->finished ? now_ns : INT64_MAX;
        tick_review(s, passed_ns);
        return now_ns;
    }
    return INT64_MAX;
}

int live_state_count(const struct live_state *s)
{
    if (s->phase != LIVE_COUNT_IN)
        return 0;
    const int64_t left_ns = COUNT_NS - (s->tick_ns - s->phase_ns);
    return clamp_int((int)((left_ns + 999999999) / 1000000000), 1, 3);
}

static bool not_in_room(const struct live_state *s)
{
    return s->screen == LIVE_ROOM && s->sight.frame && !s->sight.in_place && s->phase != LIVE_SUMMARY;
}

bool live_state_hint_warns(const struct live_state *s)
{
    return *s->trouble || !s->sight.seeing || person_gone(s) || second_person(s) || not_in_room(s);
}

const char *live_state_hint(const struct live_state *s)
{
    if (s->phase == LIVE_SUMMARY)
        return s->judged != s->finished ? "Judging the attempt" : NULL;
    if (*s->trouble)
        return s->trouble;
    if (!s->sight.seeing)
        return "Waiting for the sensor";
    if (person_gone(s))
        return s->attempt && s->phase == LIVE_DOING ? "You left the picture" : "Step into the sensor's picture";
    if (second_person(s))
        return "A second person is in the picture; only the first is judged";
    if (not_in_room(s))
        return s->sight.located
                   ? "The sensor recognised the room only now: you are shown in it from the next attempt on"
                   : "The sensor sees nothing of the room that was filmed, so you cannot be shown in it";
    if (s->too_short)
        return "That was too short to be judged: go on for a second or more";
    if (s->phase == LIVE_READY)
        return s->hands_free ? "Stand as the actor does; the count-in starts by itself"
                             : "Touch Start when you are ready";
    if (s->phase == LIVE_DOING && s->waits)
        return "The actor waits for you";
    return NULL;
}
