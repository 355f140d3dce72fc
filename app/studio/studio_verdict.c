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

void studio_verdict_draw(const struct brush *brush, const struct take_verdict *verdict, const char *failure,
                         struct scroll *scroll, struct ui_box box)
{
    const bool good = verdict_is_good(verdict) && !*failure;
    char heading[VERDICT_LINE_BYTES];
    panel(brush, box, false);
    struct ui_box in = inner(box, 20), head = cut_top(&in, 44);
    icon_draw(brush->ui, good ? ICON_CHECK : ICON_WARNING, middle(cut_left(&head, 40)), 34,
              good ? brush->theme->accent : brush->theme->warn);
    snprintf(heading, sizeof heading, "%s", verdict_headline(verdict));
    *heading = (char)toupper((unsigned char)*heading);
    label(brush, FACE_HEAD, head, brush->theme->text, heading);
    const char *lines[VERDICT_LINES + 1];
    int count = 0;
    if (*failure)
        lines[count++] = failure;
    for (int i = 0; i < verdict->count; i++)
        if (verdict_shows_line(verdict, i))
            lines[count++] = verdict->line[i].text;
    bullet_list(brush, scroll, in, lines, count);
}
