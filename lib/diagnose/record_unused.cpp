// SPDX-License-Identifier: Apache-2.0
// Columns that carry a signal's name and that this structure does not use: said, with what would use them.
#include <algorithm>

#include "diagnose/record_column.hpp"

namespace driveid::diagnose {
namespace {

std::vector<std::string> used_by(const driveid_model &model, const Roles &roles) {
  std::vector<std::string> out{"T_degC", roles.position, roles.speed, roles.input};
  const auto add = [&](std::initializer_list<const char *> names) { out.insert(out.end(), names.begin(), names.end()); };
  switch (model.structure) {
    case DRIVEID_STRUCTURE_LTI: return {"u", "y"};
    case DRIVEID_STRUCTURE_DC_CIRCUIT:
    case DRIVEID_STRUCTURE_DC_DRIVE: add({"v_V", "i_A"}); break;
    case DRIVEID_STRUCTURE_PMSM_DRIVE: add({"v_d_V", "v_q_V", "i_d_A", "i_q_A"}); break;
    case DRIVEID_STRUCTURE_TWO_MASS_AXIS: add({"theta_l_rad"}); break;
    default: break;
  }
  return out;
}

std::string instead(const std::string &name, const Roles &roles) {
  if (name == "theta_l_rad") return " (two_mass_axis fits it)";
  if (name == "v_V") return " (dc_drive and dc_circuit do)";
  if (name == "v_d_V" || name == "v_q_V") return " (pmsm_drive does)";
  if ((name == "i_A" || name == "i_q_A") && !roles.input.empty() && roles.input != name) return " (" + roles.input + " is there)";
  return "";
}

}  // namespace

void notice_unused(Prepared &record, const driveid_model &model) {
  const Roles roles = roles_of(model, record);
  const std::vector<std::string> used = used_by(model, roles);
  std::string list;
  for (const auto &[name, quality] : record.quality) {
    driveid_signal signal;
    if (quality.constant || driveid_signal_from_name(name.c_str(), &signal) || std::find(used.begin(), used.end(), name) != used.end()) continue;
    list += (list.empty() ? "" : ", ") + name + instead(name, roles);
  }
  if (!list.empty()) record.notices.push_back({"unused", std::string(driveid_structure_name(model.structure)) + " does not use " + list, ""});
}

}  // namespace driveid::diagnose
