#include "base/text.h"

#include <inttypes.h>
#include <stdio.h>

// Bytes of the printable character at `at`, which is not the end of the text; 0: there is none.
static size_t character(const unsigned char *at)
{
    if (*at < 0x80)
        return *at >= 32 && *at != 127;
    const size_t more = *at >= 0xf0 ? 3 : *at >= 0xe0 ? 2 : 1;
    if (*at < 0xc2 || *at > 0xf4)
        return 0;
    uint32_t code = *at & (0x3fu >> more);
    for (size_t i = 1; i <= more; i++) {
        if ((at[i] & 0xc0) != 0x80) // the final 0, too
            return 0;
        code = code << 6 | (at[i] & 0x3fu);
    }
    static const uint32_t least[] = {0, 0xa0, 0x800, 0x10000};
    return code >= least[more] && code <= 0x10ffff && !(code >= 0xd800 && code <= 0xdfff) ? more + 1 : 0;
}

bool text_is_printable(const char *text)
{
    const unsigned char *at = (const unsigned char *)text;
    for (size_t n; *at; at += n)
        if (!(n = character(at)))
            return false;
    return true;
}

void text_make_printable(char *text)
{
    for (char *at = text; *at;) {
        const size_t n = character((unsigned char *)at);
        if (!n)
            *at = '?';
        at += n ? n : 1;
    }
}

const char *seconds_text(int64_t time_ns, int decimals, char out[SECONDS_TEXT_BYTES])
{
    assert(decimals >= 0 && decimals <= 9);
    const uint64_t ns = time_ns < 0 ? 0 - (uint64_t)time_ns : (uint64_t)time_ns;
    uint64_t fraction = ns % 1000000000;
    for (int i = decimals; i < 9; i++)
        fraction /= 10;
    int used = snprintf(out, SECONDS_TEXT_BYTES, "%s%" PRIu64, time_ns < 0 ? "-" : "", ns / 1000000000);
    if (decimals)
        snprintf(out + used, SECONDS_TEXT_BYTES - (size_t)used, ".%0*" PRIu64, decimals, fraction);
    return out;
}
