// SPDX-License-Identifier: Apache-2.0
// driveid._core: the C ABI in Python's types. No decision is taken here; statuses go up as integers.
#include "records.hpp"

#include <driveid/sample.h>
#include <driveid/version.h>

using namespace driveid_ext;

NB_MODULE(_core, m) {
    m.doc() = "The C library of driveid: conversion only. Use the package driveid instead.";
    m.attr("version") = DRIVEID_VERSION;
    m.attr("format") = DRIVEID_FORMAT;
    m.def("status_text", [](int status) { return std::string(driveid_status_text(static_cast<driveid_status>(status))); },
          nb::arg("status"), "Sentence for a status.");

    nb::list signals;
    for (int s = 0; s < DRIVEID_SIGNAL_COUNT; s++) signals.append(driveid_signal_name(static_cast<driveid_signal>(s)));
    m.attr("SIGNALS") = nb::tuple(signals);

    bind_model(m);
    bind_diagnose(m);
    bind_online(m);
    bind_lti(m);
    bind_modal(m);
    bind_sinusoids(m);
    bind_discrete(m);
    bind_shifting(m);
}
