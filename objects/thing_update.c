#include "objects/thing_update.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// A picture or model; what there was stays where the server does not give another.
static void ask_content(const char *url, const struct http_limits *how, struct thing_content *content,
                        struct thing_update *out)
{
    struct http_limits limits = *how;
    struct http_answer answer;
    limits.most_bytes = THING_CONTENT_MOST;
    if (!url[0])
        return;
    if (http_get(url, NULL, &limits, &answer) != OK) {
        snprintf(out->content_trouble, sizeof out->content_trouble, "%s", status_message());
        return;
    }
    if (!answer.count) {
        free(answer.body);
        return;
    }
    free(content->bytes);
    *content = (struct thing_content){answer.body, answer.count};
    out->changed = true;
}

void thing_update_ask(struct recorded_thing *thing, const char *base, const char *reference,
                      const struct http_limits *limits, struct thing_update *out)
{
    char *before = thing->knowledge ? strdup(thing->knowledge) : NULL;
    struct known k = {.text = thing->knowledge};
    *out = (struct thing_update){.changed = false};
    snprintf(k.url, sizeof k.url, "%s", thing->url);
    snprintf(k.etag, sizeof k.etag, "%s", thing->knowledge ? thing->etag : ""); // else the whole answer is wanted
    const enum status status = thing_knowledge_fetch(base, reference, limits, &k);
    snprintf(out->trouble, sizeof out->trouble, "%s", k.trouble);
    thing->knowledge = k.text;
    // A server that gives no ETag sends the same again and again.
    out->changed = k.text && (!before || strcmp(before, k.text) != 0 || strcmp(thing->url, k.url) != 0);
    free(before);
    strcpy(thing->url, k.url);
    strcpy(thing->etag, k.etag);
    out->known = k.text && thing_knowledge_parse(k.text, strlen(k.text), k.url, &out->knowledge) == OK;
    if (status < OK || !out->known)
        return;
    if (out->changed || !thing->image.bytes)
        ask_content(out->knowledge.image, limits, &thing->image, out);
    if (out->changed || !thing->model.bytes)
        ask_content(out->knowledge.model, limits, &thing->model, out);
}
