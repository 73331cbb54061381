// SPDX-License-Identifier: Apache-2.0
// model.h and model_file.h: read, write, new, add.
#include "records.hpp"

#include <driveid/model_file.h>

namespace driveid_ext {
namespace {

std::optional<std::string> take(char *text) {
    if (!text) return std::nullopt;
    std::string copy(text);
    driveid_text_free(text);
    return copy;
}

nb::dict to_dict(const driveid_param &p) {
    static const char *const states[] = {"unset", "free", "given"};
    nb::dict d;
    d["name"] = p.name;
    d["unit"] = p.unit;
    d["state"] = states[p.state <= DRIVEID_PARAM_GIVEN ? p.state : 0];
    d["value"] = p.value;
    d["interval"] = nb::make_tuple(p.lo, p.hi);
    return d;
}

nb::list to_list(const driveid_param *p, uint32_t n) {
    nb::list out;
    for (uint32_t i = 0; i < n; i++) out.append(to_dict(p[i]));
    return out;
}

nb::tuple model_read(const std::string &text) {
    std::string message(1024, '\0');
    driveid_model model{};
    const driveid_status status = driveid_model_read(text.c_str(), &model, message.data(), message.size());
    if (status != DRIVEID_OK) return nb::make_tuple(static_cast<int>(status), nb::none(), message.c_str());
    nb::list effects;
    for (uint32_t e = 0; e < model.effects; e++) {
        const driveid_effect_use &use = model.effect[e];
        nb::dict d;
        d["name"] = use.name;
        d["formula"] = use.formula;
        d["adds_to"] = use.adds_to;
        d["parameters"] = to_list(use.param, use.params);
        effects.append(d);
    }
    nb::dict d;
    d["structure"] = driveid_structure_name(model.structure);
    d["parameters"] = to_list(model.param, model.params);
    d["effects"] = effects;
    return nb::make_tuple(static_cast<int>(status), d, message.c_str());
}

using Text = std::tuple<int, std::optional<std::string>, std::string>;

Text model_new(const std::string &structure, const std::vector<std::string> &given) {
    std::vector<const char *> list;
    for (const std::string &g : given) list.push_back(g.c_str());
    char *toml = nullptr;
    std::string message(1024, '\0');
    const driveid_status status = driveid_new(structure.c_str(), list.data(), list.size(), &toml, message.data(), message.size());
    return {status, take(toml), message.c_str()};
}

Text model_add(const std::string &model, const std::string &effect) {
    char *toml = nullptr;
    std::string message(1024, '\0');
    const driveid_status status = driveid_add(model.c_str(), effect.c_str(), &toml, message.data(), message.size());
    return {status, take(toml), message.c_str()};
}

}  // namespace

void bind_model(nb::module_ &m) {
    m.def("model_read", &model_read, nb::arg("text"), "(status, dictionary, message) of driveid_model_read.");
    m.def("model_new", &model_new, nb::arg("structure"), nb::arg("given"), "(status, TOML, message) of driveid_new.");
    m.def("model_add", &model_add, nb::arg("model_toml"), nb::arg("effect"), "(status, TOML, message) of driveid_add.");
    nb::list structures;
    for (int s = 0; s < DRIVEID_STRUCTURE_COUNT; s++) {
        const char *name = driveid_structure_name(static_cast<driveid_structure>(s));
        if (name) structures.append(name);
    }
    m.attr("STRUCTURES") = nb::tuple(structures);
}

}  // namespace driveid_ext
