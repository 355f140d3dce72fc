// The computer's fonts (fontconfig), for letters that the programs' own font lacks. One handle, one thread.
#pragma once
#include "base/status.h"

#ifdef __cplusplus
extern "C" {
#endif

struct system_fonts;

// NULL: no memory, no font, or built without fontconfig. Lists them, which takes some milliseconds; seconds where the
// computer's list of its fonts is not up to date.
struct system_fonts *system_fonts_open(void);
void system_fonts_close(struct system_fonts **fonts); // NULL is fine; sets *fonts = NULL

// A font as its file holds it; its letters are outlines.
struct system_font {
    uint8_t *bytes; // TrueType or OpenType; malloc'ed, the caller frees it
    size_t count;
    int index; // of the font in a file of several
};
enum { SYSTEM_FONTS_MAX = 4 };
// Reads the fonts that have the `count` letters (Unicode), each letter from the first font that has it: those that suit
// the user's language first. Returns how many fonts; letters that they all lack are left out, as are fonts that cannot
// be read.
int system_fonts_read(struct system_fonts *fonts, const uint32_t *letters, int count,
                      struct system_font out[SYSTEM_FONTS_MAX]);

#ifdef __cplusplus
}
#endif
