#include "objects/thing_knowledge.h"

#include "base/text.h"
#include "platform/files/json.h"
#include "platform/network/http_client.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_DEPTH = 4, MAX_ENTRIES = 1000 }; // of @graph and arrays that are searched for the thing

// Copies text as plain text: white space becomes single spaces, markup <...> goes.
static void plain_text(const char *from, char *out, size_t bytes)
{
    size_t used = 0;
    bool space = false;
    while (*from) {
        if (*from == '<' && strchr(from, '>')) {
            from = strchr(from, '>') + 1;
            space = used > 0;
            continue;
        }
        const size_t n = text_character_bytes(from);
        if (!n || text_is_hidden(from, n) || *from == ' ') {
            space = used > 0;
            from += n ? n : 1;
            continue;
        }
        if (used + n + space + 1 > bytes)
            break;
        if (space)
            out[used++] = ' ';
        space = false;
        memcpy(out + used, from, n);
        used += n;
        from += n;
    }
    out[used] = 0;
}

static void take_text(const struct json *object, const char *name, char *out, size_t bytes)
{
    const struct json *value = json_member(object, name);
    const char *text = NULL;
    if (json_is_array(value))
        value = json_at(value, 0);
    if (json_is_object(value) && !json_get_string(json_member(value, "@value"), &text))
        (void)json_get_string(json_member(value, "name"), &text);
    if (text || json_get_string(value, &text))
        plain_text(text, out, bytes);
}

static bool is_thing_type(const struct json *type)
{
    const char *name;
    if (!json_get_string(type, &name))
        return false;
    const char *slash = strrchr(name, '/');
    name = slash ? slash + 1 : name;
    return !strcmp(name, "Product") || !strcmp(name, "Thing") || !strcmp(name, "schema:Product") ||
           !strcmp(name, "schema:Thing") || !strcmp(name, "IndividualProduct") || !strcmp(name, "ProductModel");
}

// A type or an array of them.
static bool names_thing(const struct json *types)
{
    const struct json *type = json_is_array(types) ? json_first(types) : types;
    for (int i = 0; type && i < MAX_ENTRIES; i++, type = json_is_array(types) ? json_next(type) : NULL)
        if (is_thing_type(type))
            return true;
    return false;
}

static const struct json *find_thing(const struct json *value, int depth)
{
    if (json_is_object(value) && names_thing(json_member(value, "@type")))
        return value;
    const struct json *list = json_is_array(value) ? value : json_member(value, "@graph");
    const struct json *entry = depth < MAX_DEPTH && json_is_array(list) ? json_first(list) : NULL;
    for (int i = 0; entry && i < MAX_ENTRIES; i++, entry = json_next(entry)) {
        const struct json *found = find_thing(entry, depth + 1);
        if (found)
            return found;
    }
    return NULL;
}

// UN/CEFACT common codes that occur for weights, and what is written.
static const char *unit_name(const char *code)
{
    static const char *const names[][2] = {{"KGM", "kg"}, {"GRM", "g"}, {"LBR", "lb"}, {"ONZ", "oz"}, {"TNE", "t"}};
    for (size_t i = 0; i < COUNT_OF(names); i++)
        if (!strcmp(names[i][0], code))
            return names[i][1];
    return code;
}

static void take_weight(const struct json *thing, char *out, size_t bytes)
{
    const struct json *weight = json_member(thing, "weight");
    const char *unit = "";
    char text[64];
    double value;
    if (!json_is_object(weight)) {
        take_text(thing, "weight", out, bytes);
        return;
    }
    if (!json_get_number(json_member(weight, "value"), &value)) {
        const char *written;
        char *end;
        if (!json_get_string(json_member(weight, "value"), &written) || (value = strtod(written, &end), *end) ||
            end == written)
            return;
    }
    if (!(value >= 0 && value < 1e9))
        return;
    if (!json_get_string(json_member(weight, "unitText"), &unit) &&
        json_get_string(json_member(weight, "unitCode"), &unit))
        unit = unit_name(unit);
    snprintf(text, sizeof text, "%.6g %.16s", value, unit);
    plain_text(text, out, bytes);
}

// An address given as text or as an object with contentUrl or url; only on the server of `base`.
static void take_address(const struct json *value, const char *base, char *out, size_t bytes)
{
    const char *text = NULL;
    if (json_is_array(value))
        value = json_at(value, 0);
    if (json_is_object(value)) {
        const struct json *encoding = json_member(value, "encoding");
        if (encoding) {
            take_address(encoding, base, out, bytes);
            return;
        }
        if (!json_get_string(json_member(value, "contentUrl"), &text))
            (void)json_get_string(json_member(value, "url"), &text);
    } else {
        (void)json_get_string(value, &text);
    }
    if (text && http_resolve(base, text, out, bytes) != OK)
        out[0] = 0;
}

static bool ends_in_glb(const char *url)
{
    const size_t n = strcspn(url, "?#");
    return n > 4 && !strncmp(url + n - 4, ".glb", 4);
}

enum status thing_knowledge_parse(const char *text, size_t count, const char *url, struct thing_knowledge *out)
{
    struct json *root;
    char shown[ADDRESS_SHOWN_BYTES];
    *out = (struct thing_knowledge){0};
    enum status status = json_parse(text, count, address_shown(url, shown), &root);
    const struct json *thing = status == OK ? find_thing(root, 0) : NULL;
    if (status == OK && !thing)
        status = fail(ERR_INPUT, "%s describes no Product and no Thing of schema.org", shown);
    if (status == OK) {
        take_text(thing, "name", out->name, sizeof out->name);
        take_text(thing, "description", out->description, sizeof out->description);
        take_text(thing, "material", out->material, sizeof out->material);
        take_text(thing, "instructions", out->instructions, sizeof out->instructions);
        take_weight(thing, out->weight, sizeof out->weight);
        take_address(json_member(thing, "image"), url, out->image, sizeof out->image);
        take_address(json_member(thing, "subjectOf"), url, out->model, sizeof out->model);
        if (!out->model[0])
            take_address(json_member(thing, "model"), url, out->model, sizeof out->model);
        if (!ends_in_glb(out->model))
            out->model[0] = 0;
        if (!out->name[0])
            status = fail(ERR_INPUT, "%s gives the thing no name", shown);
    }
    json_free(&root);
    return status;
}

static enum status fetch_document(const char *base, const char *reference, const struct http_limits *limits,
                                  struct known *known)
{
    struct http_answer answer;
    struct thing_knowledge fresh;
    char url[512];
    enum status status = http_resolve(base, reference, url, sizeof url);
    if (status != OK)
        return status;
    const bool same = known->text && !strcmp(url, known->url);
    status = http_get(url, same ? known->etag : NULL, limits, &answer);
    if (status != OK)
        return status;
    char shown[ADDRESS_SHOWN_BYTES];
    address_shown(url, shown);
    if (answer.unchanged)
        return same ? NOTHING : fail(ERR_IO, "%s: the server says nothing has changed, but nothing was known", shown);
    status = answer.body ? thing_knowledge_parse((const char *)answer.body, answer.count, url, &fresh)
                         : fail(ERR_INPUT, "%s is empty", shown);
    if (status != OK) {
        free(answer.body);
        return status;
    }
    free(known->text);
    known->text = (char *)answer.body;
    known->knowledge = fresh;
    strcpy(known->url, url);
    strcpy(known->etag, answer.etag);
    return OK;
}

enum status thing_knowledge_fetch(const char *base, const char *reference, const struct http_limits *limits,
                                  struct known *known)
{
    const enum status status = fetch_document(base, reference, limits, known);
    snprintf(known->trouble, sizeof known->trouble, "%s", status < OK ? status_message() : "");
    return status;
}

static void add_text(struct json *root, const char *name, const char *text)
{
    if (text[0])
        json_add_string(root, name, text);
}

char *thing_knowledge_print(const struct thing_knowledge *knowledge)
{
    struct json *root = json_new_object();
    json_add_string(root, "@context", "https://schema.org");
    json_add_string(root, "@type", "Product");
    add_text(root, "name", knowledge->name);
    add_text(root, "description", knowledge->description);
    add_text(root, "weight", knowledge->weight);
    add_text(root, "material", knowledge->material);
    add_text(root, "instructions", knowledge->instructions);
    add_text(root, "image", knowledge->image);
    if (knowledge->model[0]) {
        struct json *model = json_add_object(root, "subjectOf");
        json_add_string(model, "@type", "3DModel");
        json_add_string(json_add_object(model, "encoding"), "contentUrl", knowledge->model);
    }
    char *text = json_print(root);
    json_free(&root);
    return text;
}
