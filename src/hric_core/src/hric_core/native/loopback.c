/* Redirects the calls of bind() in a loaded library to the loopback interface: see sockets.py. */
#define _GNU_SOURCE /* NOLINT(bugprone-reserved-identifier): of the C library */
#include "hric_core/python_numbers.h"

#include <link.h>
#include <stdint.h>
#include <sys/mman.h>

#include "hric_core/loopback.h"

/* The ELF headers of a loaded library give addresses as integers. */
/* NOLINTBEGIN(performance-no-int-to-ptr) */
struct search {
    const char *library;
    long replaced;
};

static int replace(ElfW(Addr) base, const ElfW(Rela) * relocation)
{
    const uintptr_t slot = base + relocation->r_offset, page = (uintptr_t)sysconf(_SC_PAGESIZE);
    if (mprotect((void *)(slot & ~(page - 1)), 2 * page, PROT_READ | PROT_WRITE) != 0
        && mprotect((void *)(slot & ~(page - 1)), page, PROT_READ | PROT_WRITE) != 0)
        return 0;
    *(int (**)(int, const struct sockaddr *, socklen_t))slot = hric_bind_to_loopback;
    return 1;
}

/* Replace the entries of bind() in a relocation table; return their number. */
static long replace_all(ElfW(Addr) base, const ElfW(Rela) * table, size_t size, const ElfW(Sym) * symbols,
                        const char *names)
{
    long replaced = 0;
    for (size_t i = 0; table != NULL && i < size / sizeof *table; i++)
        if (strcmp(names + symbols[ELF64_R_SYM(table[i].r_info)].st_name, "bind") == 0)
            replaced += replace(base, &table[i]);
    return replaced;
}

static int visit(struct dl_phdr_info *info, size_t Py_UNUSED(size), void *data)
{
    struct search *search = data;
    if (strstr(info->dlpi_name, search->library) == NULL)
        return 0;
    const ElfW(Rela) *calls = NULL, *others = NULL;
    const ElfW(Sym) *symbols = NULL;
    const char *names = NULL;
    size_t size_of_calls = 0, size_of_others = 0;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        if (info->dlpi_phdr[i].p_type != PT_DYNAMIC)
            continue;
        for (const ElfW(Dyn) *entry = (void *)(info->dlpi_addr + info->dlpi_phdr[i].p_vaddr); entry->d_tag; entry++)
            switch (entry->d_tag) {
            case DT_JMPREL:
                calls = (void *)entry->d_un.d_ptr;
                break;
            case DT_PLTRELSZ:
                size_of_calls = entry->d_un.d_val;
                break;
            case DT_RELA:
                others = (void *)entry->d_un.d_ptr;
                break;
            case DT_RELASZ:
                size_of_others = entry->d_un.d_val;
                break;
            case DT_SYMTAB:
                symbols = (void *)entry->d_un.d_ptr;
                break;
            case DT_STRTAB:
                names = (void *)entry->d_un.d_ptr;
                break;
            }
    }
    if (symbols != NULL && names != NULL)
        search->replaced += replace_all(info->dlpi_addr, calls, size_of_calls, symbols, names)
                            + replace_all(info->dlpi_addr, others, size_of_others, symbols, names);
    return 0;
}
/* NOLINTEND(performance-no-int-to-ptr) */

static PyObject *confine(PyObject *Py_UNUSED(module), PyObject *name)
{
    struct search search = {PyUnicode_AsUTF8(name), 0};
    if (search.library == NULL)
        return NULL;
    dl_iterate_phdr(visit, &search);
    return PyLong_FromLong(search.replaced);
}

static PyMethodDef functions[] = {
    {"confine", confine, METH_O,
     "confine(part of a loaded library's path): let its calls of bind() use loopback; return how many were replaced"},
    {0}};

MODULE(hric_loopback, functions)
