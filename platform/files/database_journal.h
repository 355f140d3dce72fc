// SQLite's rollback journal (fileformat2.html, section 3), read beside the file whose overwritten pages it should hold.
#pragma once
#include "platform/files/database_sides.h"

// Proved to be the file's, BESIDE_OWN: the journal holds page 1; the file's page 1 has either that header still, or the
// change counter that the interrupted change gave it; no two marks differ; and in the second case the marks agree, or
// another page of it is in the file still, or nothing but the header differs. *out is freed by the caller in any case.
enum beside database_journal_read(struct page_overlay *out, const struct byte_source *journal,
                                  const struct byte_source *file);
