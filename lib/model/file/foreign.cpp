// SPDX-License-Identifier: Apache-2.0
// A character beyond ASCII outside quotes and comments is no TOML; it is found before the parser meets it.
#include <string_view>

#include <driveid/model_file.h>

namespace {

// Index after the quoted text that opens at `at`; a single-line one ends with its line at the latest.
std::size_t after_quotes(std::string_view text, std::size_t at) {
  const char quote = text[at];
  const std::string_view three(text.data() + at, text.size() - at < 3 ? 0 : 3);
  const bool lines = three.size() == 3 && three[1] == quote && three[2] == quote;
  for (std::size_t k = at + (lines ? 3 : 1); k < text.size(); ++k) {
    if (quote == '"' && text[k] == '\\') ++k;
    else if (!lines && (text[k] == quote || text[k] == '\n')) return text[k] == quote ? k + 1 : k;
    else if (lines && text[k] == quote && k + 2 < text.size() && text[k + 1] == quote && text[k + 2] == quote) return k + 3;
  }
  return text.size();
}

}  // namespace

extern "C" int driveid_toml_foreign_line(const char *text, size_t size) {
  const std::string_view all(text ? text : "", text ? size : 0);
  std::size_t counted = 0;
  int line = 1;
  for (std::size_t k = 0; k < all.size();) {
    if (all[k] == '"' || all[k] == '\'') k = after_quotes(all, k);
    else if (all[k] == '#') k = all.find('\n', k) == all.npos ? all.size() : all.find('\n', k);
    else if (static_cast<unsigned char>(all[k]) >= 0x80 && !(k == 0 && all.substr(0, 3) == "\xEF\xBB\xBF")) {
      for (; counted < k; ++counted) line += all[counted] == '\n';
      return line;
    } else k += k == 0 && all.substr(0, 3) == "\xEF\xBB\xBF" ? 3 : 1;
  }
  return 0;
}
