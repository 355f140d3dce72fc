// The summary after an attempt: score, findings, a strip over time where each part differed, the place that was
// touched, and the attempts of this sitting.
#include "app/ui/screen_live.h"
#include "base/clamp.h"
#include "compare/findings.h"
#include "compare/good_parts.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const double HEAD_H = TARGET, SCORE_R = 62, MIN_PROGRESS = 150, STRIP_ROW = 20, STRIP_NAME = 150, ROW_GAP = 2;

struct summary_layout {
    struct ui_box head, score, findings, figures, strip, buttons;
    bool merged;  // head and buttons are one row
    bool one_row; // the strip shows all parts in one
};

static const double SCORE_H = 2 * 62 + 30, HIGH = 640, UPRIGHT_HIGH = 1000, LOW = 460, SCORE_W = 150;
static const double WORST_H = 330; // for the worst findings without scrolling

// Between head and buttons: the strip below, and beside or over one another score, figures and findings. What is lower
// has a strip of one row, then head and buttons in one.
static struct summary_layout compute_layout(double width, double height)
{
    const bool wide = width >= height;
    struct summary_layout l = {.merged = wide && height < HIGH && width >= 600,
                               .one_row = height < (wide ? HIGH : UPRIGHT_HIGH)};
    struct ui_box in = inner((struct ui_box){0, 0, width, height}, MARGIN);
    const double strip_h = l.one_row ? TARGET + 22 : PART_COUNT * (STRIP_ROW + ROW_GAP) + 58;
    l.head = cut_top(&in, HEAD_H);
    l.buttons = l.merged ? l.head : cut_bottom(&in, TARGET);
    l.strip = cut_bottom(&in, strip_h);
    if (wide && in.h < SCORE_H + 130) { // three columns
        l.score = cut_left(&in, SCORE_W);
        l.figures = cut_left(&in, 0.22 * in.w);
        l.findings = in;
    } else if (wide && l.one_row) {
        struct ui_box side = cut_left(&in, 0.42 * in.w);
        l.score = cut_top(&side, SCORE_H);
        l.figures = side;
        l.findings = in;
    } else if (wide) {
        l.figures = cut_left(&in, in.w * 0.46);
        l.score = in.h < SCORE_H + WORST_H ? cut_left(&in, SCORE_W) : cut_top(&in, SCORE_H);
        l.findings = in;
    } else {
        l.score = cut_top(&in, SCORE_H);
        if (in.h < LOW) // beside the score
            l.figures = cut_right(&l.score, l.score.w - SCORE_W - GAP);
        else
            l.figures = cut_top(&in, in.h * 0.5);
        l.findings = in;
    }
    return l;
}

struct ui_box screen_summary_figures(double width, double height) { return compute_layout(width, height).figures; }

double screen_summary_bottom(double width, double height)
{
    const struct ui_box strip = compute_layout(width, height).strip;
    return strip.y + strip.h;
}

// ---------------------------------------------------------------- score and progress

static uint32_t score_color(const struct theme *theme, double score)
{
    if (score >= 70)
        return theme->right;
    return score >= 45 ? theme->warn : theme->wrong;
}

static void draw_arc(const struct brush *brush, struct ui_point point, double radius, double share, uint32_t color)
{
    enum { POINTS = 64 };
    struct ui_point at[POINTS + 1];
    const int count = (int)lround(POINTS * fmin(fmax(share, 0.01), 1));
    for (int i = 0; i <= count; i++) {
        const double a = 2 * 3.14159265358979323846 * i / POINTS;
        at[i] = (struct ui_point){point.x + radius * sin(a), point.y - radius * cos(a)};
    }
    ui_stroke(brush->ui, at, count + 1, false, 12, color);
}

// The scores of this sitting's attempts, the newest at the right.
static void draw_progress(const struct brush *brush, const struct live_state *state, struct ui_box box)
{
    const struct theme *t = brush->theme;
    const int most = box.w > MIN_PROGRESS ? 12 : 5;
    const bool first = state->result_count < 2;
    const int count = state->result_count < most ? state->result_count : most;
    const double bar = fmin(28, (box.w + GAP) / most - GAP), max = fmin(box.h - 26, 100);
    for (int i = 0; i < count; i++) {
        const struct live_result *r = &state->results[state->result_count - count + i];
        const double h = r->compared ? fmax(4, max * r->score / 100) : 4;
        const struct ui_box at = {box.x + i * (bar + GAP), box.y + box.h - 26 - h, bar, h};
        const double opacity = i == count - 1 ? 1 : 0.45; // the newest stands out
        ui_fill(brush->ui, at, 5, r->compared ? faint(score_color(t, r->score), opacity) : faint(t->text, 0.2));
    }
    const char *text = !first ? "Attempts of today" : "The first attempt";
    label(brush, FACE_SMALL, (struct ui_box){box.x, box.y + box.h - 22, box.w, 22}, t->quiet, text);
}

static void draw_score(const struct brush *brush, const struct live_state *state, const struct live_page *page,
                       struct ui_box box)
{
    const struct theme *t = brush->theme;
    char text[64];
    const struct live_result *r = state->result_count ? &state->results[state->result_count - 1] : NULL;
    panel(brush, box, false);
    struct ui_box in = inner(box, 15), below = in, ring = cut_left(&in, 2 * SCORE_R + 8);
    cut_top(&below, 2 * SCORE_R + 8);
    const struct ui_point m = {ring.x + SCORE_R, ring.y + SCORE_R};
    ui_ring(brush->ui, m, SCORE_R - 8, 12, faint(t->text, 0.12));
    const bool known = page->comparison && page->comparison->relation == RELATION_SAME && r;
    if (known)
        draw_arc(brush, m, SCORE_R - 8, r->score / 100, score_color(t, r->score));
    const bool sure = !known || !(r->sigma >= 0.5); // else what the score may be off by has a line of its own
    const double top = m.y - (sure ? 30 : 39);
    snprintf(text, sizeof text, known ? "%.0f" : "–", known ? r->score : 0);
    label_centred(brush, FACE_TITLE, (struct ui_box){m.x - SCORE_R, top, 2 * SCORE_R, 44}, t->text, text);
    label_centred(brush, FACE_SMALL, (struct ui_box){m.x - SCORE_R, top + 44, 2 * SCORE_R, 22}, t->quiet, "of 100");
    snprintf(text, sizeof text, "± %.0f", known ? r->sigma : 0);
    if (!sure)
        label_centred(brush, FACE_SMALL, (struct ui_box){m.x - SCORE_R, top + 60, 2 * SCORE_R, 22}, t->quiet, text);
    cut_left(&in, 8);
    if (in.w > MIN_PROGRESS && !state->of_takes)
        draw_progress(brush, state, in);
    else if (below.h > MIN_PROGRESS - 50 && !state->of_takes)
        draw_progress(brush, state, below);
}

// ---------------------------------------------------------------- findings

int64_t finding_moment_ns(const struct comparison *comparison, const struct finding *finding)
{
    if (finding->kind != FINDING_MISSING)
        return (int64_t)(1e9 * finding_worst_s(comparison, finding));
    const int32_t wanted = (int32_t)(finding->from_s * MOVEMENT_RATE_HZ); // in the reference's time
    int32_t at = 0;
    while (at + 1 < comparison->alignment.count && comparison->alignment.pairs[at].a < wanted)
        at++;
    return comparison->alignment.count ? (int64_t)(1e9 * comparison->alignment.pairs[at].b / MOVEMENT_RATE_HZ) : 0;
}

static const struct finding *chosen_finding(const struct screens *screens, const struct live_page *page)
{
    const struct comparison *c = page->comparison;
    return c && screens->finding > 0 && screens->finding <= c->finding_count ? &c->findings[screens->finding - 1]
                                                                             : NULL;
}

// The part that it is about; -1: none.
static int chosen_part(const struct screens *screens, const struct live_page *page)
{
    const struct finding *f = chosen_finding(screens, page);
    return f ? part_by_name(f->part) : -1;
}

static const double WORDS_X = 34, LOSS_W = 40; // of a row: where its sentence begins, what the loss needs at its end

static double sentence_width(double row_w) { return row_w - WORDS_X - LOSS_W - 12; }

static double row_height(const struct brush *brush, const struct finding *finding, double width)
{
    return fmax(TARGET, ui_text_height(brush->ui, FACE_BODY, finding->sentence, sentence_width(width)) + 14);
}

static void finding_row(const struct brush *brush, const struct finding *finding, bool chosen, struct ui_box row)
{
    const struct theme *t = brush->theme;
    const double w = sentence_width(row.w), h = ui_text_height(brush->ui, FACE_BODY, finding->sentence, w);
    const bool posture =
        finding->kind == FINDING_POSTURE || finding->kind == FINDING_RANGE || finding->kind == FINDING_MIRRORED;
    char loss[16];
    if (chosen)
        ui_fill(brush->ui, row, 12, faint(t->accent, 0.2));
    // What is held differently is a disc, what is early, late or missing a ring: not by colour alone.
    const struct ui_point m = {row.x + 16, row.y + row.h / 2};
    if (posture)
        ui_disc(brush->ui, m, 7, t->wrong);
    else
        ui_ring(brush->ui, m, 6, 3, t->warn);
    ui_text_lines(brush->ui, FACE_BODY, (struct ui_point){row.x + WORDS_X, row.y + (row.h - h) / 2}, w + 1, t->text,
                  finding->sentence);
    snprintf(loss, sizeof loss, "−%.0f", finding->loss);
    if (finding->loss >= 0.5)
        label_centred(brush, FACE_STRONG,
                      (struct ui_box){row.x + row.w - LOSS_W - 8, row.y + row.h / 2 - 14, LOSS_W, 28}, t->quiet, loss);
}

// How many are listed: the worst, until all are asked for.
static int32_t listed_count(const struct screens *screens, const struct comparison *comparison)
{
    enum { WORST = 3 };
    return screens->all_findings || comparison->finding_count < WORST ? comparison->finding_count : WORST;
}

// Keys go through the list, and past the worst to the others.
static void step_finding(struct screens *screens, struct view_state *state, const struct comparison *comparison)
{
    if (!state->list_steps)
        return;
    const int to = screens->finding + state->list_steps;
    state->list_steps = 0;
    screens->finding = clamp_int(to, 1, comparison->finding_count);
    screens->all_findings |= screens->finding > listed_count(screens, comparison);
    live_state_review(&state->live, finding_moment_ns(comparison, &comparison->findings[screens->finding - 1]));
}

// "5 more" in the list's last row, a touch of which lists all.
static void more_row(const struct brush *brush, struct screens *screens, struct view_state *state, int32_t more,
                     struct ui_box row)
{
    char text[32];
    snprintf(text, sizeof text, "%d more", (int)more);
    if (touch_area(brush, "findings-more", row).tapped) {
        screens->all_findings = true;
        state->changed = true;
    }
    label(brush, FACE_STRONG, (struct ui_box){row.x + WORDS_X, row.y + (row.h - 28) / 2, row.w - WORDS_X, 28},
          brush->theme->accent, text);
}

static void list_findings(const struct brush *brush, struct screens *screens, struct view_state *state,
                          const struct comparison *comparison, struct ui_box in)
{
    const int before = screens->finding;
    step_finding(screens, state, comparison);
    const int32_t listed = listed_count(screens, comparison), left = comparison->finding_count - listed;
    double content_h = left > 0 ? TARGET : 0;
    for (int32_t i = 0; i < listed; i++)
        content_h += row_height(brush, &comparison->findings[i], in.w);
    struct scroll *scroll = &screens->findings;
    const struct brush inside = scroll_begin(brush, scroll, &in, content_h);
    double y = 0;
    int more = left;
    for (int32_t i = 0; i < listed; i++) {
        char name[32];
        const double h = row_height(brush, &comparison->findings[i], in.w);
        if (screens->finding == i + 1 && screens->finding != before)
            scroll_show(scroll, y, h);
        const struct ui_box row = {in.x, in.y + y - scroll->at, in.w, h};
        y += h;
        more += row.y + h > in.y + in.h + 1;
        if (row.y + h < in.y || row.y > in.y + in.h)
            continue;
        snprintf(name, sizeof name, "finding-%d", (int)i);
        if (touch_area(&inside, name, row).tapped) {
            screens->finding = i + 1;
            live_state_review(&state->live, finding_moment_ns(comparison, &comparison->findings[i]));
            state->changed = true;
        }
        finding_row(brush, &comparison->findings[i], screens->finding == i + 1, row);
    }
    const struct ui_box last = {in.x, in.y + y - scroll->at, in.w, TARGET};
    const bool in_sight = last.y < in.y + in.h && last.y + last.h > in.y;
    if (left > 0 && in_sight)
        more_row(&inside, screens, state, left, last);
    scroll_end(brush, scroll, left > 0 && last.y + last.h <= in.y + in.h + 1 ? 0 : more);
}

// What is good, in a line or two below the findings.
static void good_line(const struct brush *brush, const struct comparison *comparison, struct ui_box *in)
{
    char good[GOOD_TEXT_BYTES], text[GOOD_TEXT_BYTES + 8];
    if (!*good_text(comparison, good))
        return;
    snprintf(text, sizeof text, "Good: %s", good);
    const double h = ui_text_height(brush->ui, FACE_SMALL, text, in->w - 24);
    if (in->h < h + 2 * TARGET) // the findings need the room
        return;
    struct ui_box at = cut_bottom(in, h);
    icon_draw(brush->ui, ICON_CHECK, (struct ui_point){at.x + 9, at.y + 11}, 18, brush->theme->accent);
    ui_text_lines(brush->ui, FACE_SMALL, (struct ui_point){at.x + 24, at.y}, at.w - 23, brush->theme->text, text);
}

// What counts here, where somebody said so and there is room for it.
static void draw_expected(const struct brush *brush, const struct comparison *comparison, struct ui_box *in)
{
    char text[EXPECTATION_TEXT_BYTES];
    if (!*expectation_text(&comparison->expected, text))
        return;
    *text = (char)toupper((unsigned char)*text);
    const double h = ui_text_height(brush->ui, FACE_SMALL, text, in->w);
    if (h < 0.4 * in->h)
        paragraph(brush, FACE_SMALL, cut_bottom(in, h), brush->theme->quiet, text);
}

static void draw_findings(const struct brush *brush, struct screens *screens, struct view_state *state,
                          const struct live_page *page, struct ui_box box)
{
    const struct theme *t = brush->theme;
    const struct comparison *c = page->comparison;
    panel(brush, box, false);
    struct ui_box in = inner(box, 14), head = cut_top(&in, 30);
    const char *none = c ? "Nothing differs that the sensor could tell" : "";
    if (c && c->relation != RELATION_SAME)
        none = c->relation_sentence;
    if (page->why_not)
        none = page->why_not;
    label(brush, FACE_HEAD, head, t->text, "What differs");
    if (c) {
        good_line(brush, c, &in);
        draw_expected(brush, c, &in);
    }
    if (!c || !c->finding_count)
        paragraph(brush, FACE_BODY, in, t->quiet, none);
    else
        list_findings(brush, screens, state, c, in);
}

// ---------------------------------------------------------------- strip

// Of all parts at once: different where any is.
static uint8_t cell_verdict(const uint8_t cell[PART_COUNT], int part)
{
    uint8_t all = VERDICT_DIFFERENT + 1;
    if (part >= 0)
        return cell[part];
    for (int p = 0; p < PART_COUNT; p++) {
        if (cell[p] == VERDICT_DIFFERENT)
            return VERDICT_DIFFERENT;
        if (cell[p] == VERDICT_SAME || all > VERDICT_DIFFERENT)
            all = cell[p];
    }
    return all;
}

// Cells of equal verdict as one bar: solid, or for what the sensor cannot tell a thin line. What is outside of the
// alignment, getting into position and out of it, stays empty.
static void strip_row(const struct brush *brush, const struct live_page *page, int part, struct ui_box row)
{
    for (int cell = 0, end; cell < page->strip_cells; cell = end) {
        const uint8_t v = cell_verdict(page->strip[cell], part);
        for (end = cell + 1; end < page->strip_cells && cell_verdict(page->strip[end], part) == v; end++)
            ;
        const double x = row.x + row.w * cell / page->strip_cells, w = row.w * (end - cell) / page->strip_cells;
        if (v > VERDICT_DIFFERENT)
            continue;
        const bool thin = v == VERDICT_UNKNOWN;
        const struct ui_box at = {x, thin ? row.y + row.h / 2 - 1.5 : row.y, w, thin ? 3 : row.h};
        ui_fill(brush->ui, at, 0, faint(verdict_color(brush->theme, (enum verdict)v), v == VERDICT_SAME ? 0.45 : 1));
    }
}

static void part_words(int part, char out[40])
{
    snprintf(out, 40, "%s", part_name((enum part)part));
    for (char *c = out; *c; c++)
        *c = *c == '_' ? ' ' : *c;
}

static void part_rows(const struct brush *brush, const struct live_page *page, int marked, struct ui_box names,
                      struct ui_box in)
{
    for (int p = 0; p < PART_COUNT; p++) {
        char name[40];
        const double y = in.y + p * (STRIP_ROW + ROW_GAP);
        part_words(p, name);
        if (p == marked)
            ui_fill(brush->ui, (struct ui_box){names.x - 6, y - 1, in.x + in.w - names.x + 12, STRIP_ROW + ROW_GAP}, 6,
                    faint(brush->theme->accent, 0.25));
        label(brush, p == marked ? FACE_STRONG : FACE_SMALL, (struct ui_box){names.x, y, names.w, STRIP_ROW},
              p == marked ? brush->theme->text : brush->theme->quiet, name);
        strip_row(brush, page, p, (struct ui_box){in.x, y, in.w, STRIP_ROW});
    }
}

// Round the time of the chosen finding, on its part's row.
static void mark_time(const struct brush *brush, const struct finding *finding, double length_s, struct ui_box row)
{
    const double from = row.w * fmin(finding->from_s / length_s, 1), to = row.w * fmin(finding->to_s / length_s, 1);
    ui_border(brush->ui, (struct ui_box){row.x + from - 2, row.y - 2, fmax(to - from, 4) + 4, row.h + 4}, 5, 2.5,
              brush->theme->accent);
}

// Beside the time, wherever that is: the chosen finding's part where it has no row of its own, and what the strip is
// for.
static void strip_words(const struct brush *brush, int part, struct ui_box left, struct ui_box right)
{
    char words[40] = "Touch to play";
    const struct ui_box at = left.w > right.w ? left : right;
    if (part >= 0)
        part_words(part, words);
    if (at.w > ui_text_width(brush->ui, FACE_SMALL, words))
        label(brush, FACE_SMALL, at, part >= 0 ? brush->theme->accent : brush->theme->quiet, words);
}

static void draw_strip(const struct brush *brush, struct screens *screens, struct view_state *state,
                       const struct live_page *page, struct ui_box box, bool one_row)
{
    const struct theme *t = brush->theme;
    struct live_state *l = &state->live;
    panel(brush, box, false);
    struct ui_box in = inner(box, 15), names = {0, 0, 0, 0};
    if (!one_row)
        names = cut_left(&in, STRIP_NAME);
    if (!page->comparison || !page->strip)
        return;
    const struct ui_touch touch = ui_area(brush->ui, "summary-strip", (struct ui_box){in.x, box.y, in.w, box.h});
    const double rows_h = one_row ? STRIP_ROW + 6 : PART_COUNT * (STRIP_ROW + ROW_GAP), bottom = in.y + rows_h;
    const struct finding *f = chosen_finding(screens, page);
    const int part = chosen_part(screens, page);
    struct ui_box marked = {in.x, in.y, in.w, rows_h - 4}; // the row of the finding's part, or all of them
    if (one_row) {
        strip_row(brush, page, part, marked);
    } else {
        part_rows(brush, page, part, names, in);
        marked = part < 0 ? marked : (struct ui_box){in.x, in.y + part * (STRIP_ROW + ROW_GAP), in.w, STRIP_ROW};
    }
    const double length = (double)(l->review_length_ns > 0 ? l->review_length_ns : 1);
    if (f && f->kind != FINDING_MISSING) // whose times are the reference's
        mark_time(brush, f, 1e-9 * length, marked);
    const double x = in.x + in.w * fmin(1, (double)l->review_at_ns / length), time_w = label_time_width(brush, 0);
    ui_fill(brush->ui, (struct ui_box){x - 1.5, in.y - 4, 3, bottom - in.y + 4}, 1.5, t->text);
    label_time(brush, (struct ui_point){fmin(x, in.x + in.w - time_w), bottom + 2}, t->text, l->review_at_ns);
    const struct ui_box under = {names.x, bottom, names.w, 22}, left = {in.x, bottom, x - in.x - GAP, 22},
                        right = {x + time_w + GAP, bottom, in.x + in.w - x - time_w - GAP, 22};
    strip_words(brush, one_row ? part : -1, one_row ? left : under, one_row ? right : under);
    if (touch.went_down)
        screens->finding = 0; // another moment than the finding's
    if (touch.went_down || (touch.held && !l->reviewing))
        live_state_review(l, (int64_t)(fmin(fmax(touch.x / in.w, 0), 1) * length));
    state->changed |= touch.held;
}

// ---------------------------------------------------------------- figures

static void draw_figures(const struct brush *brush, const struct screens *screens, const struct live_page *page,
                         struct ui_box box)
{
    const struct theme *t = brush->theme;
    const struct take_view_image *image = page->image;
    const struct figure_view view = {
        image->lens, image->world_from_camera,
        cover_of(&image->lens, (struct ui_box){0, 0, ui_width(brush->ui), ui_height(brush->ui)}), false};
    panel(brush, box, false);
    ui_clip(brush->ui, box);
    const int part = chosen_part(screens, page);
    const struct figure attempt = {FIGURE_BODY, page->attempt, page->review_verdicts, false, part + 1},
                        reference = {FIGURE_BODY, page->reference, NULL, true,
                                     page->comparison ? judged_part(page->comparison, part) + 1 : 0};
    if (page->reference)
        figure_draw(brush, &view, &reference);
    if (page->attempt)
        figure_draw(brush, &view, &attempt);
    ui_unclip(brush->ui);
    const struct ui_box row = {box.x, box.y + box.h - 40, box.w, 30};
    const char *actor = page->mirrored && box.w > 330 ? "the actor mirrored" : "the actor";
    const char *left = box.w < 170 ? "actor" : actor, *right = "you";
    if (page->names[0]) {
        const bool room = box.w >= 170; // else the title has both
        left = room ? page->names[0] : "";
        right = room ? page->names[1] : "";
    }
    label_centred(brush, FACE_SMALL, (struct ui_box){row.x + 4, row.y, row.w / 2 - 8, row.h}, t->quiet, left);
    label_centred(brush, FACE_SMALL, (struct ui_box){row.x + row.w / 2 + 4, row.y, row.w / 2 - 8, row.h}, t->quiet,
                  right);
}

static const struct control summary_controls[] = {{"summary-again", "Again", BUTTON_MAIN, DO_PLAY_PAUSE},
                                                  {"summary-keep", "Keep as a take", BUTTON_RAISED, DO_KEEP}};

static const struct control takes_controls[] = {{"summary-takes", "Other takes", BUTTON_MAIN, DO_BACK}};

static void draw_buttons(const struct brush *brush, struct view_state *state, const struct live_page *page,
                         struct ui_box row, int64_t now_ns)
{
    static const double WIDEST = 420;
    struct ui_box at = cut_left(&row, fmin(row.w, WIDEST));
    const int done = state->live.of_takes ? controls_draw(brush, takes_controls, (int)COUNT_OF(takes_controls), at)
                                          : controls_draw(brush, summary_controls, (int)COUNT_OF(summary_controls), at);
    if (done >= 0)
        view_state_do(state, (enum view_action)done, now_ns);
    if (page->keeping && row.w > 100)
        paragraph(brush, FACE_SMALL, (struct ui_box){row.x + 8, row.y + 8, row.w - 8, row.h - 8}, brush->theme->quiet,
                  page->keeping);
}

static void draw_head(const struct brush *brush, struct view_state *state, const struct live_page *page,
                      struct ui_box head, bool merged, int64_t now_ns)
{
    char title[300];
    if (icon_button(brush, "summary-back", (struct icon_words){ICON_BACK, "Back"}, BUTTON_RAISED,
                    cut_left(&head, TARGET)))
        view_state_do(state, DO_BACK, now_ns);
    if (icon_button(brush, "summary-theme", theme_words(state->dark), BUTTON_RAISED, cut_right(&head, TARGET)))
        view_state_do(state, DO_THEME, now_ns);
    const bool judged = state->live.judged == state->live.finished, room = head.w > 420 && !merged;
    snprintf(title, sizeof title, "Attempt %d%s", state->live.results_ever,
             page->mirrored && room ? ", the actor mirrored" : "");
    if (page->names[0])
        snprintf(title, sizeof title, "%.120s compared with %.120s", page->names[1], page->names[0]);
    if (merged)
        draw_buttons(brush, state, page, cut_right(&head, state->live.of_takes ? 180 : 330), now_ns);
    const char *judging = state->live.of_takes ? "Comparing" : "Judging";
    if (room)
        judging = live_state_judging(&state->live);
    label(brush, FACE_HEAD, (struct ui_box){head.x + 8, head.y, head.w - 8, head.h}, brush->theme->text,
          judged ? title : judging);
}

void screen_summary(const struct brush *brush, struct screens *screens, struct view_state *state,
                    const struct live_page *page, int64_t now_ns)
{
    const struct ui_box all = {0, 0, ui_width(brush->ui), ui_height(brush->ui)};
    const struct summary_layout l = compute_layout(all.w, all.h);
    ui_fill(brush->ui, all, 0, brush->theme->ground);
    if (screens->summary != state->live.judged) { // another attempt's findings
        screens->summary = state->live.judged;
        screens->finding = page->comparison && page->comparison->finding_count; // whose moment it opens at
        screens->findings = (struct scroll){0};
        screens->all_findings = false;
    }
    draw_head(brush, state, page, l.head, l.merged, now_ns);
    draw_score(brush, &state->live, page, l.score);
    draw_figures(brush, screens, page, l.figures);
    draw_findings(brush, screens, state, page, l.findings);
    draw_strip(brush, screens, state, page, l.strip, l.one_row);
    if (!l.merged)
        draw_buttons(brush, state, page, l.buttons, now_ns);
    screens->image_held = ui_area(brush->ui, "image", all).held;
}
