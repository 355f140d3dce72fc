#include "tests/support/test.h"

#include "tests/support/live_glass.h"

#include "app/ui/theme.h"
#include "base/clock.h"

#include <string.h>

static const int64_t FRAME_NS = 1000000000 / 30; // of the films of live_rehearsal.h

void live_glass_open(struct glass *g, int width, int height, const struct live_glass *how)
{
    const struct viewer_options options = {.file = how->file,
                                           .take = how->take,
                                           .camera = how->camera,
                                           .sensor = how->sensor,
                                           .fixed_resolution = true,
                                           .every_frame = true,
                                           .refresh_hz = 60};
    glass_open(g, width, height, &options);
}

bool live_glass_is_doing(const struct glass *g) { return g->state->live.phase == LIVE_DOING; }

// A film that is tracked slower than it was filmed takes the screen's clock along: else the actor, who moves by that
// clock, would come to the end without the person, and the attempt would end.
static void wait_for_film(struct glass *g)
{
    const struct live_sight *sight = &g->state->live.sight;
    const bool runs = live_glass_is_doing(g) && !sight->ended;
    g->film_ns = runs ? g->film_ns + FRAME_NS * (sight->frame - g->film_frame) : glass_now_ns(g);
    g->film_frame = sight->frame;
    const int64_t ahead_ns = glass_now_ns(g) - g->film_ns - FRAME_NS;
    if (ahead_ns > 0)
        g->behind_ns += ahead_ns;
}

// As the app's own loop: drawn when there is something new.
void live_glass_draw_what_is_new(struct glass *g)
{
    wait_for_film(g);
    viewer_update(g->viewer, glass_now_ns(g));
    if (g->state->changed)
        glass_draw(g);
    else
        clock_sleep_until_ns(clock_now_ns() + 4000000);
}

void live_glass_draw_until(struct glass *g, bool (*done)(const struct glass *g))
{
    const int64_t until_ns = clock_now_ns() + 120000000000;
    do
        live_glass_draw_what_is_new(g);
    while (!done(g) && clock_now_ns() < until_ns);
    if (!done(g))
        print_error("phase %d, %lld frames, in place %d, camera's frame %lld placed %d, presence %.2f, %s\n",
                    g->state->live.phase, (long long)g->state->live.sight.frame, g->state->live.sight.in_place,
                    (long long)g->state->camera.frame, g->state->camera.placed, g->state->presence,
                    g->state->live.trouble);
    EXPECT_TRUE(done(g));
}

bool live_glass_sees_person(const struct glass *g) { return g->state->live.person_ns != 0; }
bool live_glass_is_judged(const struct glass *g)
{
    const struct live_state *l = &g->state->live;
    return l->phase == LIVE_SUMMARY && l->judged == l->finished;
}

static void print_tally(const struct glass *g, const struct live_tally *t)
{
    const struct comparison *c = &viewer_live_view(g->viewer).attempt->comparison;
    print_message("%d frames judged; right forearm different in %d, same in %d; left forearm %d, %d; %d pixels; "
                  "score %.1f\n",
                  t->frames, t->different[PART_RIGHT_FOREARM], t->same[PART_RIGHT_FOREARM],
                  t->different[PART_LEFT_FOREARM], t->same[PART_LEFT_FOREARM], t->wrong_pixels, c->score);
    for (int32_t i = 0; i < c->finding_count; i++)
        print_message("    %s\n", c->findings[i].sentence);
}

struct live_tally live_glass_do_attempt(struct glass *g)
{
    struct live_tally t = {0};
    int64_t seen = 0;
    view_state_do(g->state, DO_PLAY_PAUSE, glass_now_ns(g));
    live_glass_draw_until(g, live_glass_is_doing);
    for (int64_t until_ns = clock_now_ns() + 120000000000; !live_glass_is_judged(g) && clock_now_ns() < until_ns;) {
        live_glass_draw_what_is_new(g);
        const struct live_page *page = viewer_live_view(g->viewer).page;
        if (!live_glass_is_doing(g) || !page->verdicts || viewer_live_view(g->viewer).frame->number == seen)
            continue;
        seen = viewer_live_view(g->viewer).frame->number;
        t.frames++;
        for (int p = 0; p < PART_COUNT; p++) {
            t.different[p] += page->verdicts[p] == VERDICT_DIFFERENT;
            t.same[p] += page->verdicts[p] == VERDICT_SAME;
        }
        if (page->verdicts[PART_RIGHT_FOREARM] == VERDICT_DIFFERENT && t.different[PART_RIGHT_FOREARM] % 4 == 1) {
            glass_read(g);
            const int pixels = glass_count_color(g, theme_of(true)->wrong, 3);
            t.wrong_pixels = pixels > t.wrong_pixels ? pixels : t.wrong_pixels;
        }
    }
    print_tally(g, &t);
    return t;
}

bool live_glass_finds(const struct glass *g, const char *words)
{
    const struct comparison *c = &viewer_live_view(g->viewer).attempt->comparison;
    for (int32_t i = 0; i < c->finding_count; i++)
        if (strstr(c->findings[i].sentence, words))
            return true;
    return false;
}
