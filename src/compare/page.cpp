#include "src/compare/page.h"

#include <openssl/evp.h>

#include <nlohmann/json.hpp>

#include "src/base/check.h"

namespace cnerf::compare {

std::string page_with(const char* page, const nlohmann::ordered_json& data) {
  constexpr std::string_view kPlace = "{{data}}";
  std::string text = page;
  const std::size_t place = text.find(kPlace);
  CNERF_CHECK(place != std::string::npos, "a page has a place for its data");
  std::string json;
  for (const char c : data.dump()) json += c == '<' ? "\\u003c" : std::string(1, c);  // "</script>" would end it
  return text.replace(place, kPlace.size(), json);
}

std::string data_uri(const std::string& type, std::span<const std::byte> bytes) {
  std::string base64((bytes.size() + 2) / 3 * 4 + 1, '\0');  // and the zero that OpenSSL writes behind it
  EVP_EncodeBlock(reinterpret_cast<unsigned char*>(base64.data()), reinterpret_cast<const unsigned char*>(bytes.data()),
                  int(bytes.size()));
  base64.pop_back();
  return "data:image/" + type + ";base64," + base64;
}

}  // namespace cnerf::compare
