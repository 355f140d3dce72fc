#include "base/text.h"

#include <ctype.h>
#include <inttypes.h>
#include <locale.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <wctype.h>

// ---------------------------------------------------------------- html

void html_put_text(FILE *to, const char *text)
{
    while (*text) {
        const size_t bytes = text_character_bytes(text);
        switch (bytes ? *text : 0) {
        case '<': fputs("&lt;", to); break;
        case '>': fputs("&gt;", to); break;
        case '&': fputs("&amp;", to); break;
        case '"': fputs("&quot;", to); break;
        case 0: fputc('?', to); break;
        default: fwrite(text, 1, bytes, to);
        }
        text += bytes ? bytes : 1;
    }
}

void html_put_base64(FILE *to, const uint8_t *bytes, size_t count)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < count; i += 3) {
        const size_t left = count - i;
        const uint32_t three =
            (uint32_t)bytes[i] << 16 | (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0) | (left > 2 ? bytes[i + 2] : 0);
        fputc(digits[three >> 18], to);
        fputc(digits[three >> 12 & 63], to);
        fputc(left > 1 ? digits[three >> 6 & 63] : '=', to);
        fputc(left > 2 ? digits[three & 63] : '=', to);
    }
}

// ---------------------------------------------------------------- text

static pthread_once_t letters_once = PTHREAD_ONCE_INIT;
static locale_t letters; // the C library's knowledge of all letters, whatever the user's language; 0: it has none

static void open_letters(void) { letters = newlocale(LC_CTYPE_MASK, "C.UTF-8", (locale_t)0); }

size_t text_character_bytes(const char *text)
{
    const unsigned char *at = (const unsigned char *)text;
    if (*at < 0x80)
        return *at > 0;
    const size_t more = (size_t)1 + (*at >= 0xe0) + (*at >= 0xf0);
    if (*at < 0xc2 || *at > 0xf4)
        return 0;
    uint32_t code = *at & (0x3fu >> more);
    for (size_t i = 1; i <= more; i++) {
        if ((at[i] & 0xc0) != 0x80) // the final 0, too
            return 0;
        code = code << 6 | (at[i] & 0x3fu);
    }
    static const uint32_t min[] = {0, 0x80, 0x800, 0x10000};
    return code >= min[more] && code <= 0x10ffff && !(code >= 0xd800 && code <= 0xdfff) ? more + 1 : 0;
}

static uint32_t character_code(const char *text, size_t bytes)
{
    const unsigned char *at = (const unsigned char *)text;
    uint32_t code = bytes == 1 ? *at : *at & (0x7fu >> bytes);
    for (size_t i = 1; i < bytes; i++)
        code = code << 6 | (at[i] & 0x3fu);
    return code;
}

// The character at *at as a small letter; moves *at behind it. A byte that is no character: a number beyond them.
static uint32_t take_small_letter(const char **at)
{
    const unsigned char *from = (const unsigned char *)*at;
    const size_t bytes = text_character_bytes(*at);
    *at += bytes ? bytes : 1;
    if (!bytes)
        return 0x110000u + *from;
    const uint32_t code = character_code((const char *)from, bytes);
    if (letters)
        return (uint32_t)towlower_l((wint_t)code, letters);
    return code < 0x80 ? (uint32_t)tolower((int)code) : code;
}

bool text_contains(const char *text, const char *part)
{
    pthread_once(&letters_once, open_letters);
    for (;; take_small_letter(&text)) {
        const char *at = text, *wanted = part;
        bool same = true;
        while (same && *wanted)
            same = *at && take_small_letter(&at) == take_small_letter(&wanted);
        if (same)
            return true;
        if (!*text)
            return false;
    }
}

int text_length(const char *text)
{
    int length = 0;
    for (; *text; text++)
        length += (*text & 0xc0) != 0x80; // not those that continue one
    return length;
}

// Ranges of characters that are not shown. Unicode's categories Cc, Zl, Zp, and of Cf those that turn or hide text
// (UAX #9, #31): not the joiners U+200C and U+200D, without which Persian and many an emoji are written wrongly.
static const struct {
    uint32_t first, last;
} hidden[] = {{0x00, 0x1f},     {0x7f, 0x9f},       {0xad, 0xad},       {0x61c, 0x61c},    {0x180e, 0x180e},
              {0x200b, 0x200b}, {0x200e, 0x200f},   {0x2028, 0x202e},   {0x2060, 0x206f},  {0xfeff, 0xfeff},
              {0xfff9, 0xfffb}, {0x1bca0, 0x1bca3}, {0x1d173, 0x1d17a}, {0xe0000, 0xe0fff}};

bool text_is_hidden(const char *at, size_t bytes)
{
    const uint32_t code = character_code(at, bytes);
    for (size_t i = 0; i < COUNT_OF(hidden); i++)
        if (code >= hidden[i].first && code <= hidden[i].last)
            return true;
    return false;
}

// The same as text_character_bytes, of a printable character.
static size_t printable_bytes(const char *text)
{
    const size_t bytes = text_character_bytes(text);
    return bytes && text_is_hidden(text, bytes) ? 0 : bytes;
}

bool text_append(char *text, size_t bytes, const char *more)
{
    const size_t before = strlen(text);
    size_t end = before;
    while (*more) {
        const size_t n = printable_bytes(more);
        if (n && end + n >= bytes)
            break;
        const size_t bytes_of_it = text_character_bytes(more);
        memcpy(text + end, more, n);
        end += n;
        more += bytes_of_it ? bytes_of_it : 1;
    }
    text[end] = 0;
    return end > before;
}

void text_remove_last(char *text)
{
    size_t end = strlen(text);
    while (end && (text[end - 1] & 0xc0) == 0x80)
        end--;
    text[end ? end - 1 : 0] = 0;
}

// A character that is not wanted, or a byte that is none, becomes one '?'.
static void replace_others(char *text, size_t (*wanted)(const char *))
{
    char *to = text;
    for (const char *at = text; *at;) {
        const size_t bytes = text_character_bytes(at), n = wanted(at);
        if (n)
            memmove(to, at, n);
        else
            *to = '?';
        to += n ? n : 1;
        at += bytes ? bytes : 1;
    }
    *to = 0;
}

void text_make_utf8(char *text) { replace_others(text, text_character_bytes); }

void text_make_printable(char *text) { replace_others(text, printable_bytes); }

const char *text_shown(const char *text, char out[TEXT_SHOWN_BYTES])
{
    snprintf(out, TEXT_SHOWN_BYTES, "%s", text);
    text_make_printable(out);
    return out;
}

bool text_is_printable(const char *text)
{
    for (size_t n; *text; text += n)
        if (!(n = printable_bytes(text)))
            return false;
    return true;
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

const char *date_text(int64_t time_ns, char out[DATE_TEXT_BYTES])
{
    static const int64_t YEAR_2000_S = 946684800;
    const time_t seconds = (time_t)(time_ns / 1000000000);
    struct tm utc;
    *out = 0;
    if (seconds >= YEAR_2000_S && seconds <= SECONDS_MAX && gmtime_r(&seconds, &utc))
        strftime(out, DATE_TEXT_BYTES, "%Y-%m-%dT%H:%M:%SZ", &utc);
    return out;
}

// Numbers of up to 15 digits, which a double holds as a whole number, divided by a power of ten that it holds, too: the
// quotient is rounded once, as strtod's result is (Clinger 1990), in a tenth of the time.
static bool few_digits(const char *text, double *out)
{
    static const double power[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                   1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
    const char *at = text + (*text == '-');
    int64_t value = 0;
    int digits = 0, decimals = 0;
    bool point = false;
    for (; *at; at++) {
        if (*at == '.' && !point) {
            point = true;
            continue;
        }
        if (*at < '0' || *at > '9' || ++digits > 15)
            return false;
        value = value * 10 + (*at - '0');
        decimals += point;
    }
    const double size = (double)value / power[decimals];
    *out = *text == '-' ? -size : size;
    return true;
}

bool text_number(const char *text, double *out)
{
    const char *at = text + (*text == '-');
    size_t whole = strspn(at, "0123456789"), decimals = 0;
    at += whole;
    if (*at == '.') {
        decimals = strspn(at + 1, "0123456789");
        at += 1 + decimals;
    }
    if (!whole && !decimals)
        return false;
    if (*at == 'e' || *at == 'E') {
        at++;
        at += *at == '-' || *at == '+';
        const size_t digits = strspn(at, "0123456789");
        if (!digits)
            return false;
        at += digits;
    }
    if (*at)
        return false;
    if (!few_digits(text, out))
        *out = strtod(text, NULL);
    return true;
}

bool text_index(const char *text, int max, int *out)
{
    long long value = 0;
    if (!*text || text[strspn(text, "0123456789")])
        return false;
    for (const char *at = text; *at; at++) {
        value = 10 * value + (*at - '0');
        if (value > max)
            return false;
    }
    *out = (int)value;
    return true;
}
