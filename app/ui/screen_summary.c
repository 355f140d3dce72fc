// The summary after an attempt: score, findings, a strip over time where each part differed, the place that was
// touched, and the attempts of this sitting.
#include "app/ui/screen_live.h"

#include "compare/findings.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double HEAD_H = TARGET, SCORE_R = 62, STRIP_ROW = 20, STRIP_NAME = 150, ROW_GAP = 2;

struct summary_layout {
    struct ui_box head, score, findings, figures, strip, buttons;
};

static struct summary_layout layout(double width, double height)
{
    struct summary_layout l;
    struct ui_box in = inner((struct ui_box){0, 0, width, height}, MARGIN);
    const double strip_h = PART_COUNT * (STRIP_ROW + ROW_GAP) + 58;
    l.head = cut_top(&in, HEAD_H);
    l.buttons = cut_bottom(&in, TARGET);
    l.strip = cut_bottom(&in, strip_h);
    if (width >= height) {
        l.figures = cut_left(&in, in.w * 0.46);
        l.score = cut_top(&in, 2 * SCORE_R + 30);
        l.findings = in;
    } else {
        l.score = cut_top(&in, 2 * SCORE_R + 30);
        l.figures = cut_top(&in, in.h * 0.55);
        l.findings = in;
    }
    return l;
}

struct ui_box screen_summary_figures(double width, double height) { return layout(width, height).figures; }

// ---------------------------------------------------------------- score and progress

static uint32_t score_color(const struct theme *t, double score)
{
    return score >= 70 ? t->right : score >= 45 ? t->warn : t->wrong;
}

static void draw_arc(const struct brush *b, struct ui_point m, double radius, double share, uint32_t color)
{
    enum { POINTS = 64 };
    struct ui_point at[POINTS + 1];
    const int count = (int)lround(POINTS * fmin(fmax(share, 0.01), 1));
    for (int i = 0; i <= count; i++) {
        const double a = 2 * 3.14159265358979323846 * i / POINTS;
        at[i] = (struct ui_point){m.x + radius * sin(a), m.y - radius * cos(a)};
    }
    ui_stroke(b->ui, at, count + 1, false, 12, color);
}

// The scores of this sitting's attempts, the newest at the right.
static void draw_progress(const struct brush *b, const struct live_state *l, struct ui_box box)
{
    const struct theme *t = b->theme;
    enum { MOST = 12 };
    const int count = l->result_count < MOST ? l->result_count : MOST;
    const double bar = fmin(28, (box.w + GAP) / MOST - GAP), most = box.h - 26;
    for (int i = 0; i < count; i++) {
        const struct live_result *r = &l->results[l->result_count - count + i];
        const double h = r->compared ? fmax(4, most * r->score / 100) : 4;
        const struct ui_box at = {box.x + i * (bar + GAP), box.y + most - h, bar, h};
        const bool newest = i == count - 1;
        ui_fill(b->ui, at, 5, r->compared ? faint(score_color(t, r->score), newest ? 1 : 0.45) : faint(t->text, 0.2));
    }
    label(b, FACE_SMALL, (struct ui_box){box.x, box.y + box.h - 22, box.w, 22}, t->quiet,
          count > 1 ? "This sitting's attempts" : "The first attempt of this sitting");
}

static void draw_score(const struct brush *b, const struct live_state *l, const struct live_page *page,
                       struct ui_box box)
{
    const struct theme *t = b->theme;
    char text[64];
    const struct live_result *r = l->result_count ? &l->results[l->result_count - 1] : NULL;
    panel(b, box, false);
    struct ui_box in = inner(box, 15), ring = cut_left(&in, 2 * SCORE_R + 8);
    const struct ui_point m = {ring.x + SCORE_R, ring.y + SCORE_R};
    ui_ring(b->ui, m, SCORE_R - 8, 12, faint(t->text, 0.12));
    const bool known = page->comparison && r;
    if (known)
        draw_arc(b, m, SCORE_R - 8, r->score / 100, score_color(t, r->score));
    snprintf(text, sizeof text, known ? "%.0f" : "–", known ? r->score : 0);
    label_centred(b, FACE_TITLE, (struct ui_box){m.x - SCORE_R, m.y - 30, 2 * SCORE_R, 44}, t->text, text);
    label_centred(b, FACE_SMALL, (struct ui_box){m.x - SCORE_R, m.y + 14, 2 * SCORE_R, 22}, t->quiet, "of 100");
    cut_left(&in, 8);
    draw_progress(b, l, in);
}

// ---------------------------------------------------------------- findings

static void draw_findings(const struct brush *b, const struct live_page *page, struct ui_box box)
{
    const struct theme *t = b->theme;
    const struct comparison *c = page->comparison;
    panel(b, box, false);
    struct ui_box in = inner(box, 18);
    const char *none = page->why_not ? page->why_not : c ? "Nothing differs that the sensor could tell" : "";
    label(b, FACE_HEAD, cut_top(&in, 30), t->text, "What differs");
    if (!c || !c->finding_count) {
        ui_text_lines(b->ui, FACE_BODY, (struct ui_point){in.x, in.y + 4}, in.w, t->quiet, none);
        return;
    }
    ui_clip(b->ui, in);
    double y = in.y + 4;
    for (int32_t i = 0; i < c->finding_count; i++) {
        const struct finding *f = &c->findings[i];
        const double h = ui_text_height(b->ui, FACE_BODY, f->sentence, in.w - 30);
        if (y + h > in.y + in.h)
            break;
        const bool posture = f->kind == FINDING_POSTURE || f->kind == FINDING_RANGE || f->kind == FINDING_MIRRORED;
        ui_disc(b->ui, (struct ui_point){in.x + 9, y + 14}, 6, posture ? t->wrong : t->warn);
        ui_text_lines(b->ui, FACE_BODY, (struct ui_point){in.x + 28, y}, in.w - 29, t->text, f->sentence);
        y += h + 10;
    }
    ui_unclip(b->ui);
}

// ---------------------------------------------------------------- strip

// Cells of equal verdict as one bar: solid, or for what the sensor cannot tell a thin line. What is outside of the
// alignment, getting into position and out of it, stays empty.
static void strip_row(const struct brush *b, const struct live_page *page, int part, struct ui_box row)
{
    for (int cell = 0, end; cell < page->strip_cells; cell = end) {
        const uint8_t v = page->strip[cell][part];
        for (end = cell + 1; end < page->strip_cells && page->strip[end][part] == v; end++)
            ;
        const double x = row.x + row.w * cell / page->strip_cells, w = row.w * (end - cell) / page->strip_cells;
        if (v > VERDICT_DIFFERENT)
            continue;
        const bool thin = v == VERDICT_UNKNOWN;
        const struct ui_box at = {x, thin ? row.y + row.h / 2 - 1.5 : row.y, w, thin ? 3 : row.h};
        ui_fill(b->ui, at, 0, faint(verdict_color(b->theme, (enum verdict)v), v == VERDICT_SAME ? 0.45 : 1));
    }
}

static void draw_strip(const struct brush *b, struct view_state *s, const struct live_page *page, struct ui_box box)
{
    const struct theme *t = b->theme;
    struct live_state *l = &s->live;
    panel(b, box, false);
    struct ui_box in = inner(box, 15), names = cut_left(&in, STRIP_NAME);
    if (!page->comparison || !page->strip)
        return;
    const struct ui_touch touch = ui_area(b->ui, "summary-strip", (struct ui_box){in.x, box.y, in.w, box.h});
    for (int p = 0; p < PART_COUNT; p++) {
        char name[40];
        const double y = in.y + p * (STRIP_ROW + ROW_GAP);
        snprintf(name, sizeof name, "%s", part_name((enum part)p));
        for (char *c = name; *c; c++)
            *c = *c == '_' ? ' ' : *c;
        label(b, FACE_SMALL, (struct ui_box){names.x, y, names.w, STRIP_ROW}, t->quiet, name);
        strip_row(b, page, p, (struct ui_box){in.x, y, in.w, STRIP_ROW});
    }
    const double length = (double)(l->review_length_ns > 0 ? l->review_length_ns : 1);
    const double x = in.x + in.w * fmin(1, (double)l->review_at_ns / length),
                 bottom = in.y + PART_COUNT * (STRIP_ROW + ROW_GAP);
    ui_fill(b->ui, (struct ui_box){x - 1.5, in.y - 4, 3, bottom - in.y + 4}, 1.5, t->text);
    label_time(b, (struct ui_point){fmin(x, in.x + in.w - 60), bottom + 4}, t->text, l->review_at_ns);
    label(b, FACE_SMALL, (struct ui_box){names.x, bottom + 2, names.w, 22}, t->quiet, "Touch to play");
    if (touch.went_down || (touch.held && !l->reviewing))
        live_state_review(l, (int64_t)(fmin(fmax(touch.x / in.w, 0), 1) * length));
    s->changed |= touch.held;
}

// ---------------------------------------------------------------- figures

static void draw_figures(const struct brush *b, const struct live_page *page, struct ui_box box)
{
    const struct theme *t = b->theme;
    const struct take_view_image *p = page->image;
    const struct figure_view view = {p->lens, p->world_from_camera,
                                     cover_of(&p->lens, (struct ui_box){0, 0, ui_width(b->ui), ui_height(b->ui)}),
                                     false};
    panel(b, box, false);
    ui_clip(b->ui, box);
    const struct figure attempt = {FIGURE_BODY, page->attempt, page->review_verdicts, false},
                        reference = {FIGURE_BODY, page->reference, NULL, true};
    if (page->reference)
        figure_draw(b, &view, &reference);
    if (page->attempt)
        figure_draw(b, &view, &attempt);
    ui_unclip(b->ui);
    const struct ui_box row = {box.x, box.y + box.h - 40, box.w, 30};
    label_centred(b, FACE_SMALL, (struct ui_box){row.x, row.y, row.w / 2, row.h}, t->quiet,
                  page->mirrored ? "the actor mirrored" : "the actor");
    label_centred(b, FACE_SMALL, (struct ui_box){row.x + row.w / 2, row.y, row.w / 2, row.h}, t->quiet, "you");
}

void screen_summary(const struct brush *b, struct screens *screens, struct view_state *s, const struct live_page *page,
                    int64_t now_ns)
{
    const struct theme *t = b->theme;
    const struct ui_box all = {0, 0, ui_width(b->ui), ui_height(b->ui)};
    struct summary_layout l = layout(all.w, all.h);
    char title[64];
    ui_fill(b->ui, all, 0, t->ground);
    struct ui_box head = l.head;
    if (icon_button(b, "summary-back", ICON_BACK, BUTTON_RAISED, cut_left(&head, TARGET)))
        view_state_do(s, DO_BACK, now_ns);
    if (icon_button(b, "summary-theme", s->dark ? ICON_SUN : ICON_MOON, BUTTON_RAISED, cut_right(&head, TARGET)))
        view_state_do(s, DO_THEME, now_ns);
    snprintf(title, sizeof title, "Attempt %d%s", s->live.results_ever, page->mirrored ? ", the actor mirrored" : "");
    label(b, FACE_HEAD, (struct ui_box){head.x + 8, head.y, head.w, head.h}, t->text,
          s->live.judged == s->live.finished ? title : "Judging the attempt");
    draw_score(b, &s->live, page, l.score);
    draw_figures(b, page, l.figures);
    draw_findings(b, page, l.findings);
    draw_strip(b, s, page, l.strip);
    struct ui_box row = l.buttons;
    if (text_button(b, "summary-again", "Again", BUTTON_MAIN, cut_left(&row, 180)))
        view_state_do(s, DO_PLAY_PAUSE, now_ns);
    if (text_button(b, "summary-keep", "Keep as a take", BUTTON_RAISED, cut_left(&row, 200)))
        view_state_do(s, DO_KEEP, now_ns);
    if (page->keeping)
        label(b, FACE_SMALL, (struct ui_box){row.x + 8, row.y, row.w - 8, row.h}, t->quiet, page->keeping);
    screens->image_held = ui_area(b->ui, "image", all).held;
}
