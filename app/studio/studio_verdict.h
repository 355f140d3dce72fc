// The verdict on the studio's takes, and how it is shown.
#pragma once
#include "app/studio/studio.h"
#include "capture/take_verdict.h"

// After the take was recorded, which ended with `recorded`: judges and keeps. Returns what went wrong first; the take
// stays what it is where it cannot be judged.
MUST_CHECK enum status studio_judge(const char *file, const char *take, const struct coach *watched,
                                    enum status recorded, struct take_judgement *out);

// Heading and sentences in a panel. failure: of the take, comes first; "": none. They scroll.
void studio_verdict_draw(const struct brush *brush, const struct take_verdict *verdict, const char *failure,
                         struct scroll *scroll, struct ui_box box);
