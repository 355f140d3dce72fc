// Small things about text: UTF-8, and times as decimal seconds. Pure functions, safe from any thread.
#pragma once
#include "base/status.h"

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

// ---------------------------------------------------------------- html

// Putting text and pictures into an HTML page that is a file of its own. Any thread may call; whether the file took it
// says ferror().

// What has a meaning in HTML is escaped, in attributes, too; '?' stands for bytes that are not UTF-8.
void html_put_text(FILE *to, const char *text);

// Base64 (RFC 4648, section 4), as in a data: address.
void html_put_base64(FILE *to, const uint8_t *bytes, size_t count);

// ---------------------------------------------------------------- text

// Bytes of the well-formed UTF-8 character (RFC 3629: no overlong forms, no surrogates, at most U+10FFFF) at `at`, 1 to
// 4, which is not the end of the text; 0: there is none.
size_t text_character_bytes(const char *at);

// Characters of well-formed text: what a column of a table is as wide as.
int text_length(const char *text);

// Replaces by '?' every byte that is not part of a well-formed character: what JSON and HTML take.
void text_make_utf8(char *text);

// Whether the well-formed character of `bytes` bytes at `at` is not to be shown: a control character, also of those of
// ISO 6429 beyond ASCII (U+0080 to U+009F), which a terminal obeys; a line or paragraph separator; one that turns the
// text behind it or is not seen.
bool text_is_hidden(const char *at, size_t bytes);

// Well-formed UTF-8 of which no character is hidden.
bool text_is_printable(const char *text);

// Replaces by '?' every hidden character, and every byte that is part of no character, so that a terminal can show the
// rest.
void text_make_printable(char *text);

// Whether `part` occurs in `text`; capitals are the same as small letters, of every script that has them. What is not
// well-formed is compared byte by byte.
bool text_contains(const char *text, const char *part);

// What is typed: appends the printable characters of `more` as long as they fit whole. False: none was appended.
bool text_append(char *text, size_t bytes, const char *more);
// Removes the last character; nothing from an empty text.
void text_remove_last(char *text);

// A printable copy, for a terminal, of a name from outside; what is longer is cut. Returns out.
enum { TEXT_SHOWN_BYTES = 512 };
const char *text_shown(const char *text, char out[TEXT_SHOWN_BYTES]);

// Read times lie between minus this and this: the year 2096, counted from 1970. The difference of any two fits into an
// int64_t of nanoseconds.
#define SECONDS_MAX 4000000000

// "-1.500000000": nanoseconds as seconds with `decimals` digits, 0 to 9, the rest cut off towards zero.
enum { SECONDS_TEXT_BYTES = 32 };
const char *seconds_text(int64_t time_ns, int decimals, char out[SECONDS_TEXT_BYTES]);

// "2026-03-04T10:15:30Z" (ISO 8601, UTC): nanoseconds since 1970, leap seconds left out, as a date. "": the time is
// before the year 2000 or above SECONDS_MAX, as of a clock that counts from something else, such as a machine's start.
enum { DATE_TEXT_BYTES = 32 };
const char *date_text(int64_t time_ns, char out[DATE_TEXT_BYTES]);

// A whole text as a decimal number: -12, 0.5, 1e-3; infinite where it is too large for a double. False: it is none, as
// are hexadecimal numbers, a leading blank or plus, and nan.
bool text_number(const char *text, double *out);

// A whole text of digits alone as a number from 0 to `max`. False: it is none.
bool text_index(const char *text, int max, int *out);
