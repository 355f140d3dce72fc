#include "app/studio/studio_verdict.h"

#include <ctype.h>
#include <stdio.h>

enum status studio_judge(const char *file, const char *take, const struct coach *watched, enum status recorded,
                         struct take_judgement *out)
{
    const struct take_filming filming = {watched->purpose, watched};
    struct failure first;
    failure_keep(&first, recorded);
    const enum status status = take_verdict_keep(file, take, &filming, out);
    return first.status != OK ? failure_restore(&first) : status;
}

// The next sentence of the panel. Returns where the one after it goes.
static double draw_line(const struct brush *b, const char *line, struct ui_box in, double y)
{
    ui_disc(b->ui, (struct ui_point){in.x + 8, y + 13}, 3, b->theme->quiet);
    ui_text_lines(b->ui, FACE_BODY, (struct ui_point){in.x + 24, y}, in.w - 24, b->theme->text, line);
    return y + ui_text_height(b->ui, FACE_BODY, line, in.w - 24) + 8;
}

void studio_verdict_draw(const struct brush *b, const struct take_verdict *verdict, const char *failure,
                         struct ui_box box)
{
    const bool good = verdict_is_good(verdict) && !*failure;
    char heading[VERDICT_LINE_BYTES];
    panel(b, box, false);
    struct ui_box in = inner(box, 20), head = cut_top(&in, 44);
    icon_draw(b->ui, good ? ICON_CHECK : ICON_WARNING, middle(cut_left(&head, 40)), 34,
              good ? b->theme->accent : b->theme->warn);
    snprintf(heading, sizeof heading, "%s", verdict_headline(verdict));
    *heading = (char)toupper((unsigned char)*heading);
    label(b, FACE_HEAD, head, b->theme->text, heading);
    double y = in.y + 6;
    if (*failure)
        y = draw_line(b, failure, in, y);
    for (int i = 0; i < verdict->count && y < in.y + in.h - 26; i++)
        if (verdict_shows_line(verdict, i))
            y = draw_line(b, verdict->line[i].text, in, y);
}
