// SPDX-License-Identifier: MIT
#include <cstring>
#include <type_traits>

#include "content_sections.h"
#include "sinew/formats/package.h"
#include "sinew/formats/writer.h"

namespace sinew::formats {

PackageContent contentOf(const PackageView& package) {
  PackageContent content;
  content.info = package.info();
  for (const std::uint32_t id : section::kAll) {
    const SectionData from = package.sectionData(id);
    if (from.count == 0) continue;
    withSection(content, id, [&](auto& items) {
      using Element = typename std::remove_reference_t<decltype(items)>::value_type;
      items.resize(from.count);
      std::memcpy(items.data(), from.data, from.count * sizeof(Element));
    });
  }
  return content;
}

}  // namespace sinew::formats
