#include "platform/screen/system_fonts.h"

#ifdef HAVE_FONTCONFIG
#include "platform/files/file.h"

#include <fontconfig/fontconfig.h>
#include <stdlib.h>
#include <string.h>

struct system_fonts {
    FcConfig *config;
    FcFontSet *fonts; // best first
};

struct system_fonts *system_fonts_open(void)
{
    struct system_fonts *f = calloc(1, sizeof *f);
    FcPattern *wanted = FcPatternCreate();
    FcResult result;
    if (f && wanted && (f->config = FcInitLoadConfigAndFonts())) {
        FcPatternAddString(wanted, FC_FAMILY, (const FcChar8 *)"sans-serif");
        FcConfigSubstitute(f->config, wanted, FcMatchPattern);
        FcDefaultSubstitute(wanted); // adds the user's language, which decides how Han characters are drawn
        // Not without those whose letters others before them have: those may be of a kind that is not read here.
        f->fonts = FcFontSort(f->config, wanted, FcFalse, NULL, &result);
    }
    if (wanted)
        FcPatternDestroy(wanted);
    if (f && (!f->fonts || !f->fonts->nfont))
        system_fonts_close(&f);
    return f;
}

void system_fonts_close(struct system_fonts **fonts)
{
    if (!*fonts)
        return;
    if ((*fonts)->fonts)
        FcFontSetDestroy((*fonts)->fonts);
    if ((*fonts)->config)
        FcConfigDestroy((*fonts)->config);
    free(*fonts);
    *fonts = NULL;
}

// Pictures (emoji, bitmaps) are no outlines; of a variable font each instance is listed, and its file is none.
static bool has_outlines(FcPattern *font)
{
    FcBool outline = FcFalse, color = FcFalse, variable = FcFalse;
    FcPatternGetBool(font, FC_OUTLINE, 0, &outline);
    FcPatternGetBool(font, FC_COLOR, 0, &color);
    FcPatternGetBool(font, FC_VARIABLE, 0, &variable);
    return outline && !color && !variable;
}

// Web fonts are listed, too, and compressed. Of variable fonts only TrueType's outlines are known without variations.
static bool is_readable(const struct system_font *font, bool variable)
{
    static const uint8_t kinds[][4] = {{0, 1, 0, 0}, {'t', 'r', 'u', 'e'}, {'O', 'T', 'T', 'O'}, {'t', 't', 'c', 'f'}};
    enum { ALL = sizeof kinds / sizeof *kinds, TRUE_TYPE = 2 };
    bool readable = false;
    for (size_t i = 0; i < (variable ? TRUE_TYPE : ALL) && font->count > sizeof kinds[0]; i++)
        readable = readable || !memcmp(font->bytes, kinds[i], sizeof kinds[0]);
    return readable;
}

static bool read_font(FcPattern *font, struct system_font *out)
{
    FcChar8 *path;
    int index;
    if (FcPatternGetString(font, FC_FILE, 0, &path) != FcResultMatch ||
        FcPatternGetInteger(font, FC_INDEX, 0, &index) != FcResultMatch)
        return false;
    const int instance = index >> 16; // of a variable font
    out->index = index & 0xffff;
    if (file_read((const char *)path, &out->bytes, &out->count) != OK)
        return false;
    if (is_readable(out, instance != 0))
        return true;
    free(out->bytes);
    return false;
}

int system_fonts_read(struct system_fonts *fonts, const uint32_t *letters, int count,
                      struct system_font out[SYSTEM_FONTS_MAX])
{
    FcCharSet *missing = FcCharSetCreate();
    int found = 0;
    for (int i = 0; missing && i < count; i++)
        FcCharSetAddChar(missing, letters[i]);
    for (int i = 0; missing && i < fonts->fonts->nfont && found < SYSTEM_FONTS_MAX && FcCharSetCount(missing); i++) {
        FcPattern *font = fonts->fonts->fonts[i];
        FcCharSet *has, *rest;
        if (FcPatternGetCharSet(font, FC_CHARSET, 0, &has) != FcResultMatch || !has_outlines(font) ||
            !FcCharSetIntersectCount(missing, has) || !read_font(font, &out[found]))
            continue;
        found++;
        rest = FcCharSetSubtract(missing, has);
        FcCharSetDestroy(missing);
        missing = rest;
    }
    if (missing)
        FcCharSetDestroy(missing);
    return found;
}

#else

struct system_fonts *system_fonts_open(void) { return NULL; }

void system_fonts_close(struct system_fonts **fonts) { *fonts = NULL; }

int system_fonts_read(struct system_fonts *fonts, const uint32_t *letters, int count,
                      struct system_font out[SYSTEM_FONTS_MAX])
{
    (void)fonts;
    (void)letters;
    (void)count;
    (void)out;
    return 0;
}
#endif
