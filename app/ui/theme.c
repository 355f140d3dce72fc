#include "app/ui/theme.h"

#include <math.h>

// Inter, by Rasmus Andersson, SIL Open Font License; FONT_FOLDER is set by the build.
#define FONT(name, file)                                                                                               \
    __asm__(".section .rodata\n"                                                                                       \
            ".balign 16\n"                                                                                             \
            ".global " #name "\n" #name ":\n"                                                                          \
            ".incbin \"" FONT_FOLDER "/" file "\"\n"                                                                   \
            ".global " #name "_end\n" #name "_end:\n"                                                                  \
            ".byte 0\n"                                                                                                \
            ".previous\n");                                                                                            \
    extern const uint8_t name[], name##_end[];
FONT(font_regular, "Inter-Regular.otf")
FONT(font_medium, "Inter-SemiBold.otf")

const struct ui_face *theme_faces(void)
{
    static struct ui_face faces[FACE_COUNT];
    const size_t regular = (size_t)(font_regular_end - font_regular), medium = (size_t)(font_medium_end - font_medium);
    faces[FACE_TINY] = (struct ui_face){.bytes = font_regular, .count = regular, .size = 14};
    faces[FACE_SMALL] = (struct ui_face){.bytes = font_regular, .count = regular, .size = 16};
    faces[FACE_BODY] = (struct ui_face){.bytes = font_regular, .count = regular, .size = 20};
    faces[FACE_STRONG] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 20};
    faces[FACE_HEAD] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 25};
    faces[FACE_TITLE] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 40};
    faces[FACE_CUE] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 64, .ascii_only = true};
    faces[FACE_COUNT_IN] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 110, .digits_only = true};
    return faces;
}

static const struct theme dark = {
    .ground = 0x0d1014ff,
    .surface = 0x171b21ff,
    .glass = 0x14181ee8,
    .raised = 0x262c35ff,
    .hairline = 0xffffff1c,
    .text = 0xf2f4f7ff,
    .quiet = 0xa7b0bdff,
    .accent = 0x2dd4bfff,
    .on_accent = 0x04211dff,
    .warn = 0xfbbf24ff,
    .ghost = 0x7cb7ffff,
    .right = 0x34d399ff,
    .wrong = 0xff6b4aff,
    .unseen = 0xb4bcc8ff,
    .shadow = 0x000000a0,
    .sky = 0x2a313bff,
    .floor = 0x13171dff,
    .grid = 0xffffff2a,
};
static const struct theme light = {
    .ground = 0xf3f4f6ff,
    .surface = 0xffffffff,
    .glass = 0xfffffff0,
    .raised = 0xe9ecf0ff,
    .hairline = 0x00000018,
    .text = 0x12161cff,
    .quiet = 0x5a6472ff,
    .accent = 0x0b8578ff,
    .on_accent = 0xffffffff,
    .warn = 0xb45309ff,
    .ghost = 0x2563ebff,
    .right = 0x0d9568ff,
    .wrong = 0xd9381eff,
    .unseen = 0x7a8594ff,
    .shadow = 0x1b253540,
    .sky = 0xfafbfcff,
    .floor = 0xccd2daff,
    .grid = 0x1b253528,
};

const struct theme *theme_of(bool is_dark) { return is_dark ? &dark : &light; }

uint32_t faint(uint32_t color, double share)
{
    return (color & ~255U) | (uint32_t)lround((color & 255) * fmin(fmax(share, 0), 1));
}
