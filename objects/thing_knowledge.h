// What a knowledge base on the network says of a thing: JSON-LD in the words of schema.org (Product or Thing), read
// with suspicion. Text is plain: no control characters, no markup, cut at whole characters; addresses are kept only on
// the server's own host. Pure but for thing_knowledge_fetch.
#pragma once
#include "platform/network/http_client.h"

struct thing_knowledge {
    char name[128], description[1024], material[128], instructions[1024]; // UTF-8; "" if not given
    char weight[64];                                                      // "2.5 kg"
    char image[512], model[512];                                          // addresses; model is .glb
};

// text: `count` bytes. url: where it came from, for relative addresses. ERR_INPUT with a sentence: not JSON, no Product
// or Thing, no name.
MUST_CHECK enum status thing_knowledge_parse(const char *text, size_t count, const char *url,
                                             struct thing_knowledge *out);

// A thing's knowledge as kept: the last good answer stays when the server is absent, slow or wrong.
struct known {
    char url[512], etag[128];
    char *text; // JSON-LD of the last good answer, malloc'ed, the caller frees it; NULL: none yet
    struct thing_knowledge knowledge;
    char trouble[256]; // "" or why the last attempt brought nothing; for the label
};

// Asks the server once; blocks as http_get does. NOTHING: it has nothing newer, *known stays. On an error *known stays
// as it was but for `trouble`.
MUST_CHECK enum status thing_knowledge_fetch(const char *base, const char *reference, const struct http_limits *limits,
                                             struct known *known);

// The JSON-LD of a thing, for a server's folder; the caller frees it; NULL: no memory.
char *thing_knowledge_print(const struct thing_knowledge *knowledge);
