// The viewer page: viewer.html, embedded at build time, with the title and the model put in.
#include "reenact/export/actor_export.h"

#include "reenact/export/viewer_page.h"

#include <string.h>

static void print_escaped(FILE *out, const char *text)
{
    for (; *text; text++)
        switch (*text) {
        case '<': fputs("&lt;", out); break;
        case '>': fputs("&gt;", out); break;
        case '&': fputs("&amp;", out); break;
        case '"': fputs("&quot;", out); break;
        default: fputc(*text, out);
        }
}

// RFC 4648, section 4.
static void print_base64(FILE *out, const uint8_t *bytes, size_t count)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < count; i += 3) {
        const size_t left = count - i;
        const uint32_t three =
            (uint32_t)bytes[i] << 16 | (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0) | (left > 2 ? bytes[i + 2] : 0);
        fputc(digits[three >> 18], out);
        fputc(digits[three >> 12 & 63], out);
        fputc(left > 1 ? digits[three >> 6 & 63] : '=', out);
        fputc(left > 2 ? digits[three & 63] : '=', out);
    }
}

void actor_export_page(const char *name, const uint8_t *glb, size_t count, FILE *out)
{
    static const char title[] = "@TITLE@", model[] = "@MODEL@";
    for (const char *at = viewer_page; *at;) {
        if (!strncmp(at, title, sizeof title - 1)) {
            print_escaped(out, name);
            at += sizeof title - 1;
        } else if (!strncmp(at, model, sizeof model - 1)) {
            print_base64(out, glb, count);
            at += sizeof model - 1;
        } else {
            fputc(*at++, out);
        }
    }
}
