// The app's controls. Each is drawn and returns what was done to it; buttons are large enough for a finger.
#pragma once
#include "app/ui/theme.h"

// What scrolls, between frames; zeroed at first. Dragging anywhere in it scrolls, also over the controls inside, which
// are not touched then; scroll_turn is for the wheel and keys.
struct scroll {
    double at, grabbed_y, grabbed_at; // dp; at: how far
    bool held, moved;                 // by a finger or the mouse; moved: that was no tap
    bool was_down;
    struct ui_box box; // where it was drawn last
    double content_h;  // of what is in it
};

// What every control is drawn with.
struct brush {
    struct ui *ui;
    const struct theme *theme;
    const struct scroll *inside; // NULL: in nothing that scrolls
};

// Begins what scrolls in `box`; returns what to draw its content with, from box->y - scroll->at downwards. Where the
// content is higher than the box, the box loses a line for what scroll_end says.
struct brush scroll_begin(const struct brush *brush, struct scroll *scroll, struct ui_box *box, double content_h);
// more: how many rows are not wholly seen below; says so.
void scroll_end(const struct brush *brush, struct scroll *scroll, int more);
// Scrolls by that many rows of 58 dp if `at` is over it. False: it is not there.
bool scroll_turn(struct scroll *scroll, struct ui_point at, double rows);
// Brings what lies from y to y + h, from the content's top, into sight.
void scroll_show(struct scroll *scroll, double y, double h);

enum button_kind { BUTTON_PLAIN, BUTTON_RAISED, BUTTON_ON, BUTTON_MAIN, BUTTON_GLASS };

// An area that may be inside of something that scrolls: dragging it is no tap.
struct ui_touch touch_area(const struct brush *brush, const char *name, struct ui_box box);

// words: what it does, in a word or two; they stand under the icon where they fit, and appear beside it where the
// pointer rests on it or holds it long, which then does nothing.
struct icon_words {
    enum icon icon;
    const char *words;
};
bool icon_button(const struct brush *brush, const char *name, struct icon_words what, enum button_kind kind,
                 struct ui_box box);
struct icon_words theme_words(bool dark);                                      // of the button for the other colours
void icon_tip(const struct brush *brush, struct ui_box of, const char *words); // beside what is at `of`
bool text_button(const struct brush *brush, const char *name, const char *text, enum button_kind kind,
                 struct ui_box box);

// A row with an icon, a text and a switch. True: tapped.
bool switch_row(const struct brush *brush, const char *name, enum icon icon, const char *text, bool on,
                struct ui_box box);

struct slide {
    bool held;
    double share; // 0..1
};
// A button of as many in rows that are as wide as the box; texts are never shortened while one fits alone in a row.
struct control {
    const char *name, *text;
    enum button_kind kind;
    int action;
};
double controls_height(const struct brush *brush, const struct control *controls, int count, double width);
// Returns the action of the touched one, or -1.
int controls_draw(const struct brush *brush, const struct control *controls, int count, struct ui_box box);

// A horizontal slider.
struct slide slider(const struct brush *brush, const char *name, double share, struct ui_box box);

// A panel with a shadow. glass: translucent, over an image that moves.
void panel(const struct brush *brush, struct ui_box box, bool glass);

// Lines, broken to the box's width, from its top; returns their height. Smaller where they do not fit its height.
double paragraph(const struct brush *brush, enum face face, struct ui_box box, uint32_t color, const char *text);

// Lines with a dot before each, which scroll where the box is too low for them.
void bullet_list(const struct brush *brush, struct scroll *scroll, struct ui_box box, const char *const *lines,
                 int count);

// One line; in a smaller face where it fits in that, shortened with … where it does not.
void label(const struct brush *brush, enum face face, struct ui_box box, uint32_t color, const char *text);
void label_centred(const struct brush *brush, enum face face, struct ui_box box, uint32_t color, const char *text);

// "0:03.4" with digits of equal width, so that running time does not jitter.
void label_time(const struct brush *brush, struct ui_point top_left, uint32_t color, int64_t time_ns);
double label_time_width(const struct brush *brush, int64_t time_ns);

// Cuts a strip of that size off the box's side and returns it; the box also loses a gap beside it.
struct ui_box cut_left(struct ui_box *box, double w);
struct ui_box cut_right(struct ui_box *box, double w);
struct ui_box cut_top(struct ui_box *box, double h);
struct ui_box cut_bottom(struct ui_box *box, double h);
struct ui_box inner(struct ui_box box, double by);
struct ui_point middle(struct ui_box box);
