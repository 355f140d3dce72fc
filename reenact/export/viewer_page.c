// The viewer page: viewer.html, embedded at build time, with the title and the model put in.
#include "reenact/export/viewer_page.h"

#include "base/text.h"
#include "reenact/export/actor_export.h"

#include <string.h>

void actor_export_page(const char *name, const uint8_t *glb, size_t count, FILE *out)
{
    static const char title[] = "@TITLE@", model[] = "@MODEL@";
    for (const char *at = viewer_page; *at;) {
        if (!strncmp(at, title, sizeof title - 1)) {
            html_put_text(out, name);
            at += sizeof title - 1;
        } else if (!strncmp(at, model, sizeof model - 1)) {
            html_put_base64(out, glb, count);
            at += sizeof model - 1;
        } else {
            fputc(*at++, out);
        }
    }
}
