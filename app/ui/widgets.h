// The app's controls. Each is drawn and returns what was done to it; buttons are large enough for a finger.
#pragma once
#include "app/ui/icons.h"
#include "app/ui/theme.h"

// What every control is drawn with.
struct brush {
    struct ui *ui;
    const struct theme *theme;
};

enum button_kind { BUTTON_PLAIN, BUTTON_RAISED, BUTTON_ON, BUTTON_MAIN, BUTTON_GLASS };

bool icon_button(const struct brush *b, const char *name, enum icon icon, enum button_kind kind, struct ui_box box);
bool text_button(const struct brush *b, const char *name, const char *text, enum button_kind kind, struct ui_box box);

// A row with an icon, a text and a switch. True: tapped.
bool switch_row(const struct brush *b, const char *name, enum icon icon, const char *text, bool on, struct ui_box box);

struct slide {
    bool held;
    double share; // 0..1
};
// A horizontal slider.
struct slide slider(const struct brush *b, const char *name, double share, struct ui_box box);

// A panel with a shadow. glass: translucent, over an image that moves.
void panel(const struct brush *b, struct ui_box box, bool glass);

// One line, shortened with … if too long.
void label(const struct brush *b, enum face face, struct ui_box box, uint32_t color, const char *text);
void label_centred(const struct brush *b, enum face face, struct ui_box box, uint32_t color, const char *text);

// "0:03.4" with digits of equal width, so that running time does not jitter.
void label_time(const struct brush *b, struct ui_point top_left, uint32_t color, int64_t time_ns);
double label_time_width(const struct brush *b, int64_t time_ns);

// Cuts a strip of that size off the box's side and returns it; the box also loses a gap beside it.
struct ui_box cut_left(struct ui_box *box, double w);
struct ui_box cut_right(struct ui_box *box, double w);
struct ui_box cut_top(struct ui_box *box, double h);
struct ui_box cut_bottom(struct ui_box *box, double h);
struct ui_box inner(struct ui_box box, double by);
struct ui_point middle(struct ui_box box);
