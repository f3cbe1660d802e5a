"""The layout of the messages as a C header and as JSON."""

import textwrap
from collections.abc import Iterator
from typing import Any

from surgsim.control.external.layout import (
    DECLARATION,
    HELLO,
    JOINT_TORQUE,
    JOINT_VELOCITY,
    REPLY,
    REQUEST,
    TEXT,
    VERSION,
    Field,
    Message,
    layout_hash,
    messages,
)
from surgsim.tick.arrays import MOST_JOINTS

_WIDTH = 110
_TYPES = {"f8": "double", "i8": "int64_t", f"S{TEXT}": "char"}
_ABOUT = """What surgsim and an external controller exchange. Made by `surgsim external header`.

A process reads a surgsim_hello and text_bytes of JSON from its standard input and writes a
surgsim_declaration to its standard output; then it reads requests and writes one reply to each, until its
input ends. A function of a shared library, named f here, is

    int64_t f_declare(const surgsim_hello *hello, const char *text, surgsim_declaration *declaration);
    int64_t f(const surgsim_request *request, double *memory, double *answer);

The first fills the declaration and returns 0. The second fills answer[0..n-1] and returns 0, or 1 where there
is no command. `memory` holds as many doubles as it declared, all 0 where request->first is 1; it keeps
nothing elsewhere. Arrays over joints have room for SURGSIM_MOST_JOINTS: the arm's n come first.
SI units; frames W world, T tip, C trocar; matrices row by row. Numbers are little-endian, without gaps."""
_READ = """
/* Read or write all of `bytes`; 0, or -1 where the other end is closed. */
static inline int surgsim_read(int file, void *to, size_t bytes) {
    for (char *at = (char *)to; bytes > 0;) {
        ssize_t got = read(file, at, bytes);
        if (got <= 0) return -1;
        at += got, bytes -= (size_t)got;
    }
    return 0;
}

static inline int surgsim_write(int file, const void *from, size_t bytes) {
    for (const char *at = (const char *)from; bytes > 0;) {
        ssize_t put = write(file, at, bytes);
        if (put <= 0) return -1;
        at += put, bytes -= (size_t)put;
    }
    return 0;
}

/* The declaration of a controller of that name and version, which wants so many doubles of memory. */
static inline void surgsim_declare(surgsim_declaration *d, const char *name, const char *release,
                                   int64_t memory) {
    memset(d, 0, sizeof *d);
    d->magic = SURGSIM_DECLARATION, d->version = SURGSIM_VERSION, d->hash = SURGSIM_HASH, d->memory = memory;
    strncpy(d->name, name, sizeof d->name - 1);
    strncpy(d->release, release, sizeof d->release - 1);
}

typedef int64_t (*surgsim_function)(const surgsim_request *, double *memory, double *answer);

/* A process that answers with a function as above; `memory` is its own. Returns its exit status.
 * What the program prints goes to standard error: standard output belongs to the replies. */
static inline int surgsim_serve(const char *name, const char *release, surgsim_function f, double *memory,
                                size_t doubles) {
    int out = dup(1);
    surgsim_hello hello;
    surgsim_declaration declaration;
    dup2(2, 1);
    if (surgsim_read(0, &hello, sizeof hello) || hello.magic != SURGSIM_HELLO) return 1;
    for (int64_t left = hello.text_bytes; left > 0;) {
        char text[4096];
        size_t count = left < (int64_t)sizeof text ? (size_t)left : sizeof text;
        if (surgsim_read(0, text, count)) return 1;
        left -= (int64_t)count;
    }
    surgsim_declare(&declaration, name, release, 0);
    if (surgsim_write(out, &declaration, sizeof declaration)) return 1;
    for (;;) {
        surgsim_request request;
        surgsim_reply reply = {SURGSIM_REPLY, 0, 0, {0}};
        if (surgsim_read(0, &request, sizeof request)) return 0; /* the run is over */
        if (request.first) memset(memory, 0, doubles * sizeof *memory);
        reply.tick = request.tick;
        reply.status = f(&request, memory, reply.answer);
        if (surgsim_write(out, &reply, sizeof reply)) return 0;
    }
}
"""


def header_text() -> str:
    """The C header."""
    constants = {
        "VERSION": VERSION,
        "MOST_JOINTS": MOST_JOINTS,
        "JOINT_VELOCITY": JOINT_VELOCITY,
        "JOINT_TORQUE": JOINT_TORQUE,
    }
    words = {
        "HASH": layout_hash(),
        "HELLO": HELLO,
        "DECLARATION": DECLARATION,
        "REQUEST": REQUEST,
        "REPLY": REPLY,
    }
    lines = [
        *_comment(_ABOUT),
        "#ifndef SURGSIM_EXTERNAL_H",
        "#define SURGSIM_EXTERNAL_H",
        "",
        "#include <stdint.h>",
        "#include <string.h>",
        "#include <unistd.h>",
        "",
        *(f"#define SURGSIM_{name} {value}" for name, value in constants.items()),
        *(f"#define SURGSIM_{name} INT64_C({value})" for name, value in words.items()),
    ]
    for message in messages():
        lines += ["", *_struct(message)]
    sizes = [
        f'_Static_assert(sizeof(surgsim_{message.name}) == {message.dtype.itemsize}, "no gaps");'
        for message in messages()
    ]
    return "\n".join([*lines, "", "#ifndef __cplusplus", *sizes, "#endif", _READ, "#endif", ""])


def _comment(text: str) -> Iterator[str]:
    lines = text.split("\n")
    yield f"/* {lines[0]}"
    yield from (f" * {line}".rstrip() for line in lines[1:])
    yield " */"


def _struct(message: Message) -> Iterator[str]:
    yield f"/* {message.meaning} */"
    yield "typedef struct {"
    for field in message.fields:
        yield from _member(field)
    yield f"}} surgsim_{message.name};"


def _member(field: Field) -> Iterator[str]:
    """A line of the struct, and what it means beside or above it."""
    shape = f"[{TEXT}]" if field.type.startswith("S") else "".join(f"[{size}]" for size in field.shape)
    told = _told(field)
    line = f"    {_TYPES[field.type]} {field.name}{shape};"
    if len(line) + len(told) + 7 <= _WIDTH:
        yield f"{line} /* {told} */"
        return
    wrapped = textwrap.wrap(told, _WIDTH - 12)
    yield from (
        f"    {'/*' if i == 0 else ' *'} {part}{' */' if i + 1 == len(wrapped) else ''}"
        for i, part in enumerate(wrapped)
    )
    yield line


def _told(field: Field) -> str:
    size = f" ({', '.join(field.shown.split())})" if field.shown else ""
    return f"{field.meaning}{size}{f' [{field.unit}]' if field.unit else ''}"


def layout_json() -> dict[str, Any]:
    """The same for programs: sizes, constants, and every field with its offset in bytes."""
    words = {"hello": HELLO, "declaration": DECLARATION, "request": REQUEST, "reply": REPLY}
    return {
        "version": VERSION,
        "hash": layout_hash(),
        "byte_order": "little",
        "most_joints": MOST_JOINTS,
        "gives": {"joint_velocity": JOINT_VELOCITY, "joint_torque": JOINT_TORQUE},
        "messages": {
            message.name: {
                "magic": words[message.name],
                "bytes": message.dtype.itemsize,
                "meaning": message.meaning,
                "fields": [_field(message, field) for field in message.fields],
            }
            for message in messages()
        },
    }


def _field(message: Message, field: Field) -> dict[str, Any]:
    fields = message.dtype.fields
    assert fields is not None
    return {
        "name": field.name,
        "type": field.type,
        "offset": fields[field.name][1],
        "shape": list(field.shape),
        "for_n_joints": field.shown,
        "unit": field.unit,
        "meaning": field.meaning,
    }
