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
static const int64_t SECOND_NS = 1500000000;      // said for at least this long
static const int64_t LEAD_NS = 400000000;         // follow: the actor is at most so far ahead
static const int64_t TAIL_NS = 900000000;         // after the actor's end, for a person who is a little late
static const int64_t LATE_NS = 4000000000;        // follow: longer, for one who is still on the way
static const int64_t REST_NS = 1500000000;        // between two loops
static const int64_t MIN_PART_NS = 500000000;     // a shorter part is not marked
static const int64_t MIN_ATTEMPT_NS = 1000000000; // a shorter attempt at more than that is not judged
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
                               .hands_free = true,
                               .counting.counts = {true, true, true, true}};
}

static void enter_phase(struct live_state *state, enum live_phase phase, int64_t now_ns)
{
    state->phase = phase;
    state->phase_ns = now_ns;
    state->end_ns = 0;
    state->waits = false;
    state->reviewing = state->too_short = state->marks_asked = false;
    if (phase != LIVE_SUMMARY)
        state->at_ns = state->marked_from_ns;
}

void live_state_to_ready(struct live_state *state, int64_t now_ns)
{
    if (state->of_takes)
        state->judged = state->finished; // a result that is still to come is not shown
    state->of_takes = false;
    enter_phase(state, LIVE_READY, now_ns);
}

void live_state_compare_takes(struct live_state *state, int64_t now_ns)
{
    state->of_takes = true;
    state->result_count = state->results_ever = 0;
    state->marked_from_ns = state->marked_to_ns = 0;
    state->review_at_ns = state->review_from_ns = state->review_length_ns = 0;
    state->finished = ++state->attempt;
    enter_phase(state, LIVE_SUMMARY, now_ns);
}

static void begin_attempt(struct live_state *state, int64_t now_ns)
{
    enter_phase(state, LIVE_DOING, now_ns);
    state->attempt++;
    state->attempt_mirrored = state->mirrored;
    state->sight.judged = false; // what was judged before is of another instant
}

static void finish_attempt(struct live_state *state, int64_t now_ns)
{
    state->finished = state->attempt;
    enter_phase(state, LIVE_SUMMARY, now_ns);
}

// Stopped before the part's end. What says nothing about the movement is not judged, nor counted.
static void stop_attempt(struct live_state *state, int64_t now_ns)
{
    if (now_ns - state->phase_ns >= MIN_ATTEMPT_NS) {
        finish_attempt(state, now_ns);
        return;
    }
    enter_phase(state, state->loop && state->finished ? LIVE_SUMMARY : LIVE_READY,
                now_ns); // of a loop, the attempt before is shown
    state->too_short = state->phase == LIVE_READY;
}

void live_state_open_take(struct live_state *state, int64_t length_ns, const struct orbit *orbit, int64_t now_ns)
{
    state->length_ns = state->marked_to_ns = length_ns;
    state->marked_from_ns = 0;
    state->loop = state->of_takes = false;
    state->orbit = *orbit;
    state->result_count = state->results_ever = 0;
    state->finished = state->judged = state->attempt;
    state->tick_ns = now_ns;
    state->person_ns = 0;
    enter_phase(state, LIVE_READY, now_ns);
}

// ---------------------------------------------------------------- actions

static void next_screen(struct live_state *state)
{
    state->screen = (state->screen + 1) % LIVE_SCREENS;
    if (state->screen == LIVE_ROOM && !state->has_camera)
        state->screen = LIVE_MIRROR;
}

static void change_tempo(struct live_state *state, int by)
{
    int nearest = 0;
    for (int i = 1; i < LIVE_TEMPOS; i++)
        if (fabs(live_tempos[i] - state->tempo) < fabs(live_tempos[nearest] - state->tempo))
            nearest = i;
    state->tempo = live_tempos[clamp_int(nearest + by, 0, LIVE_TEMPOS - 1)];
}

static void set_part_mark(struct live_state *state, bool from)
{
    if (state->phase != LIVE_DOING && state->phase != LIVE_READY)
        return;
    if (state->phase == LIVE_READY) { // where nothing moves a mark takes the part back
        state->marked_from_ns = 0;
        state->marked_to_ns = state->length_ns;
        state->at_ns = 0;
        return;
    }
    if (from && state->at_ns + MIN_PART_NS <= state->marked_to_ns) {
        state->marked_from_ns = state->at_ns;
    } else if (!from && state->at_ns >= state->marked_from_ns + MIN_PART_NS) {
        state->marked_to_ns = state->at_ns;
        state->loop = true;
    }
}

// An attempt is judged by one reference throughout.
static void mirror_actor(struct live_state *state, int64_t now_ns)
{
    state->mirrored = !state->mirrored;
    if (state->phase == LIVE_DOING)
        enter_phase(state, LIVE_COUNT_IN, now_ns);
}

static void start_or_stop(struct live_state *state, int64_t now_ns)
{
    switch (state->phase) {
    case LIVE_READY:
    case LIVE_SUMMARY: enter_phase(state, LIVE_COUNT_IN, now_ns); break;
    case LIVE_COUNT_IN: enter_phase(state, LIVE_READY, now_ns); break;
    case LIVE_DOING: stop_attempt(state, now_ns); break;
    }
}

static void switch_counting(struct live_state *state, enum live_group group)
{
    int others = 0;
    for (int g = 0; g < LIVE_GROUPS; g++)
        others += g != (int)group && state->counting.counts[g];
    if (!others)
        return;
    state->counting.counts[group] = !state->counting.counts[group];
    state->counting_changed = true;
}

// The next larger one, and after the largest none.
static void next_tolerance(struct live_state *state, enum live_group group)
{
    static const double tolerances_deg[] = {5, 10, 20, 30};
    double *now = &state->counting.tolerance_deg[group], next = 0;
    for (int i = (int)COUNT_OF(tolerances_deg) - 1; i >= 0; i--)
        if (tolerances_deg[i] > *now + 0.5)
            next = tolerances_deg[i];
    *now = next;
    state->counting_changed = true;
}

bool live_state_is_marked(const struct live_state *state)
{
    return state->marked_from_ns > 0 || state->marked_to_ns < state->length_ns;
}

static void count_marked(struct live_state *state)
{
    state->marks_asked = !live_state_is_marked(state);
    if (state->marks_asked)
        return;
    state->counting.from_ns = state->marked_from_ns;
    state->counting.to_ns = state->marked_to_ns;
    state->counting_changed = true;
}

static void count_all(struct live_state *state)
{
    state->counting_changed |= state->counting.to_ns > 0;
    state->counting.from_ns = state->counting.to_ns = 0;
}

void live_state_do(struct live_state *state, enum live_action action, int64_t now_ns)
{
    if (state->of_takes && action != LIVE_DO_BACK_STEP && action != LIVE_DO_ON_STEP)
        return; // there is nothing to do again, or to keep
    state->marks_asked = false;
    if (action >= LIVE_DO_COUNT && action <= LIVE_DO_COUNT_LAST) {
        switch_counting(state, (enum live_group)(action - LIVE_DO_COUNT));
        return;
    }
    if (action >= LIVE_DO_TOLERANCE && action <= LIVE_DO_TOLERANCE_LAST) {
        next_tolerance(state, (enum live_group)(action - LIVE_DO_TOLERANCE));
        return;
    }
    switch (action) {
    case LIVE_DO_START: start_or_stop(state, now_ns); break;
    case LIVE_DO_SCREEN: next_screen(state); break;
    case LIVE_DO_PACE: state->pace = state->pace == LIVE_FOLLOW ? LIVE_KEEP_UP : LIVE_FOLLOW; break;
    case LIVE_DO_SLOWER: change_tempo(state, -1); break;
    case LIVE_DO_FASTER: change_tempo(state, 1); break;
    case LIVE_DO_OVER: state->over = !state->over; break;
    case LIVE_DO_GHOST: state->ghost = !state->ghost; break;
    case LIVE_DO_HANDS_FREE: state->hands_free = !state->hands_free; break;
    case LIVE_DO_MARK_FROM: set_part_mark(state, true); break;
    case LIVE_DO_MARK_TO: set_part_mark(state, false); break;
    case LIVE_DO_COUNT_MARKED: count_marked(state); break;
    case LIVE_DO_COUNT_ALL: count_all(state); break;
    case LIVE_DO_LOOP: state->loop = !state->loop; break;
    case LIVE_DO_MIRROR: mirror_actor(state, now_ns); break;
    case LIVE_DO_KEEP: state->keep_wanted |= state->phase == LIVE_SUMMARY; break;
    case LIVE_DO_BACK_STEP:
        if (state->phase == LIVE_SUMMARY)
            live_state_review(state, (state->reviewing ? state->review_from_ns : state->review_at_ns) - STEP_BACK_NS);
        break;
    case LIVE_DO_ON_STEP:
        if (state->phase == LIVE_SUMMARY)
            live_state_review(state, (state->reviewing ? state->review_from_ns : state->review_at_ns) + STEP_BACK_NS);
        break;
    default: break;
    }
}

void live_state_review(struct live_state *state, int64_t at_ns)
{
    if (state->phase != LIVE_SUMMARY || state->review_length_ns <= 0)
        return;
    state->review_from_ns = clamp_int64(at_ns, 0, state->review_length_ns);
    state->review_at_ns = state->review_from_ns;
    state->reviewing = true;
}

// ---------------------------------------------------------------- what the sensor says

void live_state_on_sight(struct live_state *state, const struct live_sight *sight, int64_t now_ns)
{
    const bool is_new = sight->frame != state->sight.frame;
    state->frame_ns = is_new ? now_ns : state->frame_ns;
    state->sight = *sight;
    state->sight.trouble = NULL;
    snprintf(state->trouble, sizeof state->trouble, "%s", sight->trouble ? sight->trouble : "");
    if (!is_new && sight->seeing)
        return;
    if (sight->person && sight->seeing) {
        state->person_ns = state->person_ns ? state->person_ns : now_ns;
        state->gone_ns = 0;
    } else {
        state->gone_ns = state->gone_ns ? state->gone_ns : now_ns;
        if (now_ns - state->gone_ns >= GONE_NS)
            state->person_ns = 0;
    }
    if (sight->second_person)
        state->second_ns = now_ns;
}

// The person was there for less than a second of a longer part.
static bool says_nothing(const struct live_state *state, int64_t length_ns)
{
    return length_ns > 0 && length_ns < MIN_ATTEMPT_NS && state->marked_to_ns - state->marked_from_ns >= MIN_ATTEMPT_NS;
}

void live_state_on_result(struct live_state *state, const struct live_result *result, int64_t length_ns, int64_t now_ns)
{
    if (says_nothing(state, length_ns)) {
        state->judged = state->finished;
        if (state->phase == LIVE_SUMMARY)
            enter_phase(state, LIVE_READY, now_ns);
        state->too_short = state->phase == LIVE_READY;
        return;
    }
    if (state->result_count == LIVE_ATTEMPTS) {
        memmove(state->results, state->results + 1, sizeof state->results - sizeof state->results[0]);
        state->result_count--;
    }
    state->results[state->result_count++] = *result;
    state->results_ever++;
    state->judged = state->finished;
    state->review_length_ns = length_ns;
    state->review_at_ns = state->review_from_ns = result->worst_ns < length_ns ? result->worst_ns : length_ns;
    state->reviewing = false;
    state->phase_ns = state->phase == LIVE_SUMMARY ? now_ns : state->phase_ns;
}

static bool person_gone(const struct live_state *state)
{
    return state->gone_ns && state->tick_ns - state->gone_ns >= GONE_NS;
}

static bool second_person(const struct live_state *state)
{
    return state->second_ns && state->tick_ns - state->second_ns < SECOND_NS && !person_gone(state);
}

// ---------------------------------------------------------------- time

// Follow: whether the person is where the actor is, in time or in pose. The pose counts too, for where the actor holds
// one, its instants look alike.
static bool person_keeps(const struct live_state *state)
{
    if (!state->sight.judged || !state->sight.person)
        return false;
    return state->at_ns <= state->sight.reference_ns + LEAD_NS || state->sight.away_rad < AWAY_RAD;
}

// At the end: whether the person has arrived, too.
static bool person_arrived(const struct live_state *state)
{
    return state->sight.judged &&
           (state->sight.reference_ns >= state->marked_to_ns - LEAD_NS || state->sight.away_rad < AWAY_RAD);
}

static void tick_at_end(struct live_state *state, int64_t now_ns)
{
    state->end_ns = state->end_ns ? state->end_ns : now_ns;
    const int64_t since_ns = now_ns - state->end_ns;
    const bool late = state->pace == LIVE_FOLLOW && !person_arrived(state);
    if (since_ns < (late ? LATE_NS : TAIL_NS))
        return;
    if (!state->loop) {
        finish_attempt(state, now_ns);
        return;
    }
    if (state->finished != state->attempt)
        state->finished = state->attempt; // judged while the person rests
    if (since_ns >= TAIL_NS + REST_NS || late)
        begin_attempt(state, now_ns);
}

static void tick_doing(struct live_state *state, int64_t now_ns, int64_t passed_ns)
{
    if (state->gone_ns && now_ns - state->gone_ns >= GIVE_UP_NS) {
        enter_phase(state, LIVE_READY, now_ns);
        return;
    }
    if (state->sight.ended) {
        stop_attempt(state, now_ns);
        return;
    }
    state->waits = state->pace == LIVE_FOLLOW && !person_keeps(state) && state->at_ns < state->marked_to_ns;
    if (!state->waits)
        state->at_ns += (int64_t)((double)passed_ns * state->tempo);
    if (state->at_ns >= state->marked_to_ns) {
        state->at_ns = state->marked_to_ns;
        tick_at_end(state, now_ns);
    }
}

static void tick_review(struct live_state *state, int64_t passed_ns)
{
    state->review_at_ns += passed_ns;
    if (state->review_at_ns < state->review_from_ns + REVIEW_NS && state->review_at_ns < state->review_length_ns)
        return;
    state->review_at_ns = state->review_from_ns; // rests at the place that was touched
    state->reviewing = false;
}

int64_t live_state_tick(struct live_state *state, int64_t now_ns)
{
    const int64_t passed_ns = clamp_int64(now_ns - state->tick_ns, 0, 100000000); // a longer stall moves no one
    state->tick_ns = now_ns;
    const bool there = state->person_ns && !person_gone(state);
    switch (state->phase) {
    case LIVE_READY:
        if (state->hands_free && there && now_ns - state->person_ns >= STAND_NS && now_ns - state->phase_ns >= STAND_NS)
            enter_phase(state, LIVE_COUNT_IN, now_ns);
        return there ? now_ns : INT64_MAX;
    case LIVE_COUNT_IN:
        if (now_ns - state->phase_ns >= COUNT_NS)
            begin_attempt(state, now_ns);
        else if (person_gone(state))
            enter_phase(state, LIVE_READY, now_ns);
        return now_ns;
    case LIVE_DOING: tick_doing(state, now_ns, passed_ns); return now_ns;
    case LIVE_SUMMARY:
        if (!state->reviewing)
            return state->judged != state->finished ? now_ns : INT64_MAX;
        tick_review(state, passed_ns);
        return now_ns;
    }
    return INT64_MAX;
}

int live_state_count(const struct live_state *state)
{
    if (state->phase != LIVE_COUNT_IN)
        return 0;
    const int64_t left_ns = COUNT_NS - (state->tick_ns - state->phase_ns);
    return clamp_int((int)((left_ns + 999999999) / 1000000000), 1, 3);
}

static bool not_in_room(const struct live_state *state)
{
    return state->screen == LIVE_ROOM && state->sight.frame && !state->sight.in_place && state->phase != LIVE_SUMMARY;
}

const char *live_state_judging(const struct live_state *state)
{
    return state->of_takes ? "Comparing the takes" : "Judging the attempt";
}

bool live_state_hint_warns(const struct live_state *state)
{
    if (state->of_takes)
        return false;
    return *state->trouble || !state->sight.seeing || person_gone(state) || second_person(state) || not_in_room(state);
}

const char *live_state_hint(const struct live_state *state)
{
    if (state->phase == LIVE_SUMMARY)
        return state->judged != state->finished ? live_state_judging(state) : NULL;
    if (*state->trouble)
        return state->trouble;
    if (!state->sight.seeing)
        return "Waiting for the sensor";
    if (person_gone(state))
        return state->attempt && state->phase == LIVE_DOING ? "You left the picture" : "Step into the sensor's picture";
    if (second_person(state))
        return "A second person is in the picture; only the first is judged";
    if (not_in_room(state))
        return state->sight.located
                   ? "The sensor recognised the room only now: you are shown in it from the next attempt on"
                   : "The sensor sees nothing of the room that was filmed, so you cannot be shown in it";
    if (state->marks_asked)
        return "Mark a part first: \"From here\" and \"To here\", while the actor moves";
    if (state->too_short)
        return "That was too short to be judged: go on for a second or more";
    if (state->phase == LIVE_READY)
        return state->hands_free ? "Stand as the actor does; the count-in starts by itself"
                                 : "Touch Start when you are ready";
    if (state->phase == LIVE_DOING && state->waits)
        return "The actor waits for you";
    return NULL;
}
