// Whether a file has exactly the tables that these programs make, as it must have to be written to: a rule in it of
// another hand (ON CONFLICT REPLACE, UNIQUE, CHECK, DEFAULT, COLLATE, an index, a trigger, a computed column) decides
// what a row that is added does to those that are there, or takes time without end.
#pragma once
#include "platform/files/database.h"

// Any order of the columns behind `id`, and older files' fewer columns, are good. ERR_CORRUPT, with a sentence that
// names the first thing that is not as made; ERR_IO, ERR_MEMORY of reading.
MUST_CHECK enum status exact_schema_check(struct database *db);
