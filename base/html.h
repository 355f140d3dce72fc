// Putting text and pictures into an HTML page that is a file of its own. Any thread may call; whether the file took it
// says ferror().
#pragma once
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

// What has a meaning in HTML is escaped, in attributes, too; '?' stands for bytes that are not UTF-8.
void html_put_text(FILE *to, const char *text);

// Base64 (RFC 4648, section 4), as in a data: address.
void html_put_base64(FILE *to, const uint8_t *bytes, size_t count);
