#!/usr/bin/perl
# Prints a software bill of materials (SPDX 2.3, JSON) of programs: the Debian packages that their shared libraries are of.
#   perl scripts/bill_of_materials.pl FILE...
use strict;
use warnings;
use JSON::PP;
use POSIX qw(strftime);

# The shared libraries that the loader finds for a file, links resolved.
sub libraries_of {
  my ($file) = @_;
  my @found = map { m{=> (/\S+)} ? $1 : () } qx(ldd '$file');
  die "$file: ldd finds no library\n" if !@found;
  return map { chomp(my $real = qx(readlink -f '$_')); $real } @found;
}

# The Debian package of a file: name, version, source package. Nothing where the file is not Debian's.
sub package_of {
  my ($file) = @_;
  (my $before_merge = $file) =~ s{^/usr/}{/};  # /lib is /usr/lib, and packages may have either
  my ($owner) = qx(dpkg-query -S '$file' '$before_merge' 2> /dev/null) =~ /^(\S+):\s/;
  return if !$owner;
  my ($name, $version, $source) = split /\t/, qx(dpkg-query -W -f '\${Package}\t\${Version}\t\${source:Package}' '$owner');
  return {name => $name, version => $version, source => $source};
}

# A package as SPDX describes it.
sub entry_of {
  my ($package, $distribution) = @_;
  my ($name, $version) = @{$package}{qw(name version)};
  (my $id = $name) =~ s/[^A-Za-z0-9.-]/-/g;
  (my $escaped = $version) =~ s/([^A-Za-z0-9.~-])/sprintf '%%%02X', ord $1/ge;
  return {
    SPDXID => "SPDXRef-$id", name => $name, versionInfo => $version, downloadLocation => 'NOASSERTION',
    sourceInfo => "built from the Debian source package $package->{source}", filesAnalyzed => JSON::PP::false,
    licenseConcluded => 'NOASSERTION', licenseDeclared => 'NOASSERTION', copyrightText => 'NOASSERTION',
    externalRefs => [{referenceCategory => 'PACKAGE-MANAGER', referenceType => 'purl',
      referenceLocator => "pkg:deb/debian/$name\@$escaped?distro=$distribution"}],
  };
}

my %packages;
my %libraries = map { $_ => 1 } map { libraries_of($_) } @ARGV;
for my $library (sort keys %libraries) {
  my $package = package_of($library) or die "$library is of no Debian package\n";
  $packages{$package->{name}} = $package;
}
my ($distribution) = qx(cat /etc/os-release) =~ /^VERSION_CODENAME=(\w+)/m;
my ($version) = qx('$ARGV[0]' --version) =~ /^cnerf (\S+)/m;
my @entries = map { entry_of($packages{$_}, $distribution) } sort keys %packages;
my $made = strftime '%Y-%m-%dT%H:%M:%SZ', gmtime($ENV{SOURCE_DATE_EPOCH} // time);
my $program = {
  SPDXID => 'SPDXRef-cnerf', name => 'cnerf', versionInfo => $version, downloadLocation => 'NOASSERTION',
  filesAnalyzed => JSON::PP::false, licenseConcluded => 'Apache-2.0', licenseDeclared => 'Apache-2.0',
  copyrightText => 'NOASSERTION',
};
print JSON::PP->new->canonical->pretty->encode({
  spdxVersion => 'SPDX-2.3', dataLicense => 'CC0-1.0', SPDXID => 'SPDXRef-DOCUMENT', name => "cnerf-$version",
  documentNamespace => "urn:cnerf:$version:$distribution:" . time, creationInfo => {created => $made, creators => ['Tool: scripts/bill_of_materials.pl']},
  packages => [$program, @entries],
  relationships => [
    {spdxElementId => 'SPDXRef-DOCUMENT', relationshipType => 'DESCRIBES', relatedSpdxElement => 'SPDXRef-cnerf'},
    map { {spdxElementId => 'SPDXRef-cnerf', relationshipType => 'DYNAMIC_LINK', relatedSpdxElement => $_->{SPDXID}} } @entries,
  ],
});
